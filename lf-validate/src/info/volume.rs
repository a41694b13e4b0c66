//! Description of a volume.

use super::numbers::{figures, product, whole};
use super::{description::Description, objects::brief, summary::Summary};
use crate::scores::units::AXES;
use lf_core::{Grid, History, Tile};
use serde_json::{Map, Value};

/// Describes a sparse volume: its grid, the tile that the file holds, the `count` voxels held, columns by name, and
/// other entries of its header.
pub fn volume(
    grid: &Grid,
    tile: Option<&Tile>,
    count: usize,
    columns: &[(&str, &[f32])],
    extra: &Map<String, Value>,
    history: &History,
) -> Description {
    let mut about = Description::new("sparse volume (.lfv)");
    let [nx, ny, nz] = grid.shape;
    about
        .line("grid", format!("{nx} x {ny} x {nz} = {} voxels of {} mm", whole(grid.len()), product(&grid.spacing_mm)));
    for (axis, name) in AXES.into_iter().enumerate() {
        let half = 0.5 * grid.spacing_mm[axis];
        let ends = [grid.centre_mm(axis, 0) - half, grid.centre_mm(axis, grid.shape[axis] - 1) + half];
        about.line(format!("extent {name}"), format!("{} to {} mm", figures(ends[0]), figures(ends[1])));
    }
    if let Some(Tile { index, of, halo_mm, core_vox: [[x0, x1], [y0, y1]], .. }) = tile {
        let core = format!("voxels {x0} to {} along x, {y0} to {} along y", x1 - 1, y1 - 1);
        about.line("tile", format!("{index} of {of}: {core}; halo {} mm", figures(*halo_mm)));
    }
    let percent = 100.0 * count as f64 / grid.len() as f64;
    about.line("voxels held", format!("{}, {} % of the grid", whole(count as u64), figures(percent)));
    for (name, values) in columns {
        about.line(format!("column {name}"), Summary::of(*values).to_string());
    }
    extra.iter().for_each(|(key, value)| about.line(key, brief(value)));
    about.history(history);
    about
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_extent_reaches_the_faces_of_its_voxels() {
        let grid = Grid { shape: [4, 2, 1], spacing_mm: [0.5, 1.0, 10.0], origin_mm: [-0.75, -0.5, 0.0] };
        let extra = serde_json::json!({"mask": [0, 4]});
        let extra = extra.as_object().unwrap();
        let text = volume(&grid, None, 2, &[("score", &[1.0, 3.0])], extra, &Vec::new()).to_string();
        for wanted in [
            "4 x 2 x 1 = 8 voxels of 0.5 x 1 x 10 mm",
            "-1 to 1 mm",
            "-5 to 5 mm",
            "2, 25 % of the grid",
            "min 1, max 3, mean 2, sum 4",
            "[0,4]",
            "none",
        ] {
            assert!(text.contains(wanted), "{wanted} is not in\n{text}");
        }
        let tile = Tile { index: 2, of: 2, halo_mm: 0.5, core_vox: [[2, 4], [0, 2]], pixels: [[0, 9], [0, 9]] };
        let text = volume(&grid, Some(&tile), 0, &[("score", &[])], &Map::new(), &Vec::new()).to_string();
        assert!(text.contains("2 of 2: voxels 2 to 3 along x, 0 to 1 along y; halo 0.5 mm"), "{text}");
        assert!(text.contains("no values"));
    }
}
