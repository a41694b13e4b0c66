//! Descriptions of images, volumes and vector fields.

use super::numbers::{Summary, figures, percent, product, short, whole};
use super::{description::Description, objects::brief};
use crate::scores::units::AXES;
use lf_core::field::{MEASURED, REPLACED};
use lf_core::{Field, Grid, History, Tile, frame};
use serde_json::{Map, Value};

/// Further runs of equal pages are counted only.
const MOST_RUNS: usize = 12;

/// Describes an image of `width` x `height` pixels. `pages`: the name of each page of its file, the image being the
/// first, and size and samples in words.
pub fn image<'a>(
    pages: &[(String, String)],
    [width, height]: [usize; 2],
    pixels: impl IntoIterator<Item = &'a f32>,
    history: &History,
) -> Description {
    let summary = Summary::of(pixels);
    let mut about = Description::new("grey image (.exr, .tif or .png)");
    match pages {
        [] => {}
        [(_, stored)] => about.line("stored", stored),
        _ => list(pages, &mut about),
    }
    about.line("size", format!("{width} x {height} px = {} pixels", whole(summary.count as u64)));
    about.line("counts", summary.to_string());
    about.line("zero pixels", format!("{}, {}", whole(summary.zero as u64), percent(summary.zero, summary.count)));
    if summary.min < 0.0 {
        about.line("", "some are negative, as where a background was subtracted");
    }
    about.history(history);
    about
}

/// Lists the pages of a file, equal neighbours in one line.
fn list(pages: &[(String, String)], about: &mut Description) {
    about.line(
        "pages",
        format!("{}, each a frame; the rest of this text is about the first", whole(pages.len() as u64)),
    );
    let mut runs = pages.chunk_by(|(_, one), (_, next)| one == next);
    for run in runs.by_ref().take(MOST_RUNS) {
        let ((first, stored), (last, _)) = (&run[0], &run[run.len() - 1]);
        let names = if run.len() == 1 { first.clone() } else { format!("{first} to {last}") };
        about.line("", format!("{names}: {stored}"));
    }
    let rest = runs.map(<[_]>::len).sum::<usize>();
    if rest > 0 {
        about.line("", format!("and {} more", whole(rest as u64)));
    }
}

/// Describes a sparse volume: grid, tile that the file holds, `count` voxels held, columns, and other header entries.
pub fn volume(
    grid: &Grid,
    tile: Option<&Tile>,
    count: usize,
    columns: &[(&str, &[f32])],
    extra: &Map<String, Value>,
    history: &History,
) -> Description {
    let mut about = Description::new("sparse volume (.lfv)");
    about.line(frame::KEY, frame::MARK);
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
    about.line("voxels held", format!("{}, {} % of the grid", whole(count as u64), short(percent)));
    for (name, values) in columns {
        about.line(format!("column {name}"), Summary::of(*values).to_string());
    }
    extra.iter().for_each(|(key, value)| about.line(key, brief(value)));
    about.history(history);
    about
}

/// Describes a vector field. Its statistics are of the vectors that are measured or replaced.
pub fn field(field: &Field) -> Description {
    let layout = &field.layout;
    let mut about = Description::new("vector field (.exr, .nc)");
    about.line(frame::KEY, frame::MARK);
    let [nx, ny, nz] = layout.shape;
    let total = field.flag.len();
    about.line(
        "vectors",
        format!("{nx} x {ny} x {nz} = {}, every {} mm", whole(total as u64), product(&layout.spacing_mm)),
    );
    for (axis, name) in AXES.into_iter().enumerate() {
        let first = layout.origin_mm[axis];
        let last = first + layout.shape[axis].saturating_sub(1) as f64 * layout.spacing_mm[axis];
        about.line(format!("places {name}"), format!("{} to {} mm", figures(first), figures(last)));
    }
    about.line("voxel", format!("{} mm", product(&layout.voxel_mm)));
    if layout.window.contains(&0) {
        about.line("window", "none: not correlated");
    } else {
        let window = layout.window.map(|n| n as f64);
        let length = [0, 1, 2].map(|axis| window[axis] * layout.voxel_mm[axis]);
        let overlap = figures(100.0 * layout.overlap);
        about.line("window", format!("{} voxels = {} mm, overlap {overlap} %", product(&window), product(&length)));
    }
    if let Some(dt_s) = layout.dt_s {
        about.line("time step", format!("{} s", figures(dt_s)));
    }
    let count = |flag: f32| field.flag.iter().filter(|&&found| found == flag).count();
    let (measured, replaced) = (count(MEASURED), count(REPLACED));
    for (label, count) in [("measured", measured), ("replaced", replaced), ("no data", total - measured - replaced)] {
        about.line(label, format!("{}, {}", whole(count as u64), percent(count, total)));
    }
    let held = |values: &[f32]| {
        let kept = values.iter().zip(&field.flag).filter(|(_, flag)| [MEASURED, REPLACED].contains(*flag));
        Summary::of(kept.map(|(value, _)| value))
    };
    let labels = ["u (mm)", "v (mm)", "w (mm)", "peak", "ratio", "su (mm)", "sv (mm)", "sw (mm)", "count"];
    let Field { u, v, w, peak, ratio, su, sv, sw, count, .. } = field;
    for (label, values) in labels.into_iter().zip([u, v, w, peak, ratio, su, sv, sw, count]) {
        about.line(label, held(values).to_string());
    }
    about.history(&layout.history);
    about
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::info::description::assert_shows;
    use lf_core::field::NO_DATA;

    #[test]
    fn counts_of_a_small_image() {
        let text = image(&[], [3, 1], &[0.0, 4.0, 5.0], &Vec::new()).to_string();
        assert!(text.contains("3 x 1 px") && text.contains("mean 3, sum 9") && text.contains("1, 33.3 %"));
        assert!(!text.contains("negative"));
        assert!(!text.contains("pages"));
        assert!(image(&[], [1, 1], &[-1.0], &Vec::new()).to_string().contains("negative"));
    }

    #[test]
    fn equal_pages_share_a_line() {
        let page = |n: usize, stored: &str| (format!("f.tif:{n}"), stored.to_owned());
        let mut pages: Vec<_> = (0..4).map(|n| page(n, "2 x 1 px, 8-bit grey")).collect();
        pages.push(page(4, "a colour palette"));
        let text = |pages: &[_]| image(pages, [1, 1], &[1.0], &Vec::new()).to_string();
        assert_shows(&text(&pages), &["5, each a frame", "f.tif:0 to f.tif:3: 2 x 1 px", "f.tif:4: a colour palette"]);
        assert_shows(&text(&pages[..1]), &["stored", "2 x 1 px, 8-bit grey"]);
        pages = (0..20).map(|n| page(n, &format!("{n}"))).collect();
        assert_shows(&text(&pages), &["f.tif:11: 11", "and 8 more"]);
    }

    #[test]
    fn an_extent_reaches_the_faces_of_its_voxels() {
        let grid = Grid { shape: [4, 2, 1], spacing_mm: [0.5, 1.0, 10.0], origin_mm: [-0.75, -0.5, 0.0] };
        let extra = serde_json::json!({"mask": [0, 4]});
        let extra = extra.as_object().unwrap();
        let text = volume(&grid, None, 2, &[("score", &[1.0, 3.0])], extra, &Vec::new()).to_string();
        assert_shows(&text, &["4 x 2 x 1 = 8 voxels of 0.5 x 1 x 10 mm", "-1 to 1 mm", "-5 to 5 mm"]);
        assert_shows(&text, &["2, 25 % of the grid", "min 1, max 3, mean 2, sum 4", "[0,4]", "none"]);
        let tile = Tile { index: 2, of: 2, halo_mm: 0.5, core_vox: [[2, 4], [0, 2]], pixels: [[0, 9], [0, 9]] };
        let text = volume(&grid, Some(&tile), 0, &[("score", &[])], &Map::new(), &Vec::new()).to_string();
        assert!(text.contains("2 of 2: voxels 2 to 3 along x, 0 to 1 along y; halo 0.5 mm"), "{text}");
        assert!(text.contains("no values"));
    }

    #[test]
    fn ranges_leave_out_places_without_data() {
        let mut truth = crate::scores::fixtures::field([4, 5, 3], |_| [0.5, 0.0, -1.0]);
        truth.u[7] = 1e6;
        truth.flag[7] = NO_DATA;
        let text = field(&truth).to_string();
        assert_shows(&text, &["4 x 5 x 3 = 60", "-3 to 1 mm", "none: not correlated", "measured  59, 98.3 %"]);
        assert_shows(&text, &["min 0.5, max 0.5", "no finite value", "count     no finite value"]);
        truth.layout.window = [32, 32, 16];
        truth.layout.overlap = 0.75;
        truth.layout.dt_s = Some(2.5e-4);
        truth.count.fill(9.0);
        let text = field(&truth).to_string();
        let window = "32 x 32 x 16 voxels = 0.32 x 0.64 x 1.6 mm, overlap 75 %";
        assert_shows(&text, &[window, "0.00025 s", "count      min 9, max 9"]);
    }
}
