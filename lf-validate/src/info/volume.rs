use super::description::{Sheet, by, figures, range, whole};
use super::objects::brief;
use super::summary::Summary;
use lf_core::grid::Grid;
use lf_core::history::History;
use lf_core::volume::tile::Tile;
use serde_json::{Map, Value};

/// Describes a sparse volume: its grid, what tile of it the file is, `count` voxels held, columns by name, and what else its
/// header says.
pub fn volume(
    grid: &Grid,
    tile: Option<&Tile>,
    count: usize,
    columns: &[(&str, &[f32])],
    extra: &Map<String, Value>,
    history: &History,
) -> Sheet {
    let mut sheet = Sheet::new("sparse volume (.lfv)");
    let [nx, ny, nz] = grid.shape;
    sheet.line("grid", format!("{nx} x {ny} x {nz} = {} voxels of {} mm", whole(grid.len()), by(&grid.spacing_mm)));
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let half = 0.5 * grid.spacing_mm[axis];
        let ends = [grid.centre_mm(axis, 0) - half, grid.centre_mm(axis, grid.shape[axis] - 1) + half];
        sheet.line(format!("extent {name}"), format!("{} to {} mm", figures(ends[0]), figures(ends[1])));
    }
    if let Some(Tile { index, of, halo_mm, core_vox: [[x0, x1], [y0, y1]], .. }) = tile {
        let core = format!("voxels {x0} to {} along x, {y0} to {} along y", x1 - 1, y1 - 1);
        sheet.line("tile", format!("{index} of {of}: {core}; halo {} mm", figures(*halo_mm)));
    }
    let percent = 100.0 * count as f64 / grid.len() as f64;
    sheet.line("voxels held", format!("{}, {} % of the grid", whole(count as u64), figures(percent)));
    for (name, values) in columns {
        sheet.line(format!("column {name}"), range(&Summary::of(*values)));
    }
    extra.iter().for_each(|(key, value)| sheet.line(key, brief(value)));
    sheet.history(history);
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extents_reach_the_voxels_rims() {
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
