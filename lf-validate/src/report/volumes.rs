//! Pruning by depth, misfit by sweep, light by depth.

use super::folder::spread;
use super::html::Section;
use super::source::Source;
use lf_core::{Refusal, Result, Volume};
use lf_plot::{Axis, Chart, Mark, Panel};

/// Upper limit of the files that are read; they are spread over the run.
const MOST_FILES: usize = 4;
/// Volumes with more slices have no curve over depth.
const MOST_SLICES: usize = 10_000;

/// Voxels that pruning kept, by depth. None without supports.
pub(super) fn pruning(source: &dyn Source, supports: &[String], notes: &mut Vec<String>) -> Option<Section> {
    let curves = curves(source, supports, notes, |volume| {
        let [nx, ny, _] = volume.grid().shape;
        let kept = by_slice(volume, std::iter::repeat(&1.0))?;
        Ok(kept.into_iter().map(|count| 100.0 * count / (nx * ny) as f64).collect())
    });
    let shares: Vec<String> = curves.iter().map(|curve| format!("{:.2} %", mean(&curve.points))).collect();
    let mut section = Section::new("pruning", "Pruning");
    let axis = Axis::from_zero("voxels kept, %", 1.05 * highest(&curves));
    section.chart(
        &one_panel("Voxels kept by lf-prune, by depth", Axis::new("z, mm"), axis, &curves),
        "Only these voxels are reconstructed.",
    );
    section.text(&format!("Kept of all voxels: {}.", shares.join(", ")));
    (!curves.is_empty()).then_some(section)
}

/// Light of the reconstructed volumes by depth, and the misfit by sweep. None without either.
pub(super) fn reconstruction(
    source: &dyn Source,
    volumes: &[String],
    records: &[String],
    notes: &mut Vec<String>,
) -> Option<Section> {
    let mut section = Section::new("reconstruction", "Reconstruction");
    let sweeps = sweeps(source, records);
    if !sweeps.is_empty() {
        section.chart(
            &one_panel("Misfit of the image, by sweep", Axis::new("sweep"), Axis::log("misfit"), &sweeps),
            "The difference between the image and the light that the volume would send, as a share of the image.",
        );
    }
    let curves = curves(source, volumes, notes, |volume| by_slice(volume, volume.require("intensity")?));
    if !curves.is_empty() {
        let axis = Axis::from_zero("light of a slice, counts", 1.05 * highest(&curves));
        section.chart(
            &one_panel("Light of the volumes, by depth", Axis::new("z, mm"), axis, &curves),
            "A slab that is lit evenly, with many particles, gives a flat curve.",
        );
    }
    (!section.content.is_empty()).then_some(section)
}

/// A named curve over depth or sweeps.
#[derive(Clone)]
struct Curve {
    name: String,
    points: Vec<[f64; 2]>,
}

/// A curve of each of a few files: values by slice.
fn curves(
    source: &dyn Source,
    files: &[String],
    notes: &mut Vec<String>,
    values: impl Fn(&Volume) -> Result<Vec<f64>>,
) -> Vec<Curve> {
    let curve = |file: &str| -> Result<Curve> {
        let volume = source.volume(file)?;
        let grid = volume.grid();
        let points = values(&volume)?.into_iter().enumerate().map(|(n, value)| [grid.centre_mm(2, n), value]).collect();
        Ok(Curve { name: file.trim_end_matches(".lfv").to_owned(), points })
    };
    let mut curves = Vec::new();
    for file in spread(files, MOST_FILES) {
        match curve(file) {
            Ok(curve) => curves.push(curve),
            Err(error) => notes.push(error.to_string()),
        }
    }
    curves
}

/// Sums of a value of every voxel over the slices across z. Refuses a volume with more than [`MOST_SLICES`].
fn by_slice<'a>(volume: &Volume, values: impl IntoIterator<Item = &'a f32>) -> Result<Vec<f64>> {
    let grid = volume.grid();
    let slices = grid.shape[2];
    let found = || format!("{slices} slices, too many for a curve by depth");
    Refusal::unless(slices <= MOST_SLICES, found, format!("wanted {MOST_SLICES} at most"))
        .map_err(|refusal| refusal.about(volume.name()))?;
    let mut sums = vec![0.0; grid.shape[2]];
    for (index, value) in volume.indices().iter().zip(values) {
        sums[grid.voxel(*index)[2]] += f64::from(*value);
    }
    Ok(sums)
}

/// The misfits that lf-mart wrote by --log.
fn sweeps(source: &dyn Source, files: &[String]) -> Vec<Curve> {
    let read = |file: &str| -> Curve {
        let text = source.text(file).unwrap_or_default();
        let number = |line: &str, key: &str| serde_json::from_str::<serde_json::Value>(line).ok()?[key].as_f64();
        let points = text.lines().filter_map(|line| Some([number(line, "iteration")?, number(line, "misfit")?]));
        Curve { name: file.trim_end_matches(".jsonl").to_owned(), points: points.collect() }
    };
    // Other tools write records of other kinds.
    let curves: Vec<Curve> = files.iter().map(|file| read(file)).filter(|curve| !curve.points.is_empty()).collect();
    spread(&curves, MOST_FILES).into_iter().cloned().collect()
}

fn one_panel(title: &str, x: Axis, y: Axis, curves: &[Curve]) -> Chart {
    let mut panel = Panel::new("", x, y);
    panel.marks = curves.iter().map(|curve| Mark::line(&curve.name, curve.points.clone())).collect();
    Chart { title: title.into(), notes: Vec::new(), columns: 1, panels: vec![panel] }
}

fn highest(curves: &[Curve]) -> f64 {
    curves.iter().flat_map(|curve| &curve.points).map(|point| point[1]).fold(0.0, f64::max)
}

fn mean(points: &[[f64; 2]]) -> f64 {
    points.iter().map(|point| point[1]).sum::<f64>() / points.len().max(1) as f64
}
