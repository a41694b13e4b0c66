//! Particles by depth, and their stated uncertainty against the bound.

use super::folder::spread;
use super::html::Section;
use super::source::Source;
use crate::scores::precision::{Experiment, Noise, Precision, precision};
use lf_core::statistics::median;
use lf_core::{Camera, Particle, particles};
use lf_plot::{Axis, Chart, Mark, Panel};

const MOST_FILES: usize = 8;
const SLABS: usize = 12;
/// Side of the windows of the bound, pixels of the focal plane.
const WINDOW_PX: f64 = 160.0;
/// Standard deviation of a particle, pixels of the focal plane: that of the bound.
const SIGMA_PX: f64 = 0.75;

/// The section. `noise`: gain and read noise of the frames, counts, if a fit found them. None without tables.
pub(super) fn section(
    source: &dyn Source,
    files: &[String],
    camera: Option<&Camera>,
    noise: Option<[f64; 2]>,
    notes: &mut Vec<String>,
) -> Option<Section> {
    let mut all: Vec<Particle> = Vec::new();
    let chosen = spread(files, MOST_FILES);
    let mut tables = 0;
    for file in chosen {
        let read = source.text(file).and_then(|text| particles::read(&text).map_err(|fault| fault.about(file)));
        match read {
            Ok(found) => {
                all.extend(found);
                tables += 1;
            }
            Err(error) => notes.push(error.to_string()),
        }
    }
    let [low, high] = [f64::INFINITY, f64::NEG_INFINITY];
    let [low, high] = all.iter().fold([low, high], |[low, high], p| [low.min(p.place_mm[2]), high.max(p.place_mm[2])]);
    if all.is_empty() || low >= high {
        return None;
    }
    let mut section = Section::new("particles", "Particles");
    section.text(&format!(
        "{} particles in {tables} tables, {:.0} a table.",
        all.len(),
        all.len() as f64 / tables as f64
    ));
    let per_lenslet = camera.map(|camera| density(camera, all.len() as f64 / tables as f64));
    let light = median(&mut all.iter().map(|particle| particle.intensity).collect::<Vec<f64>>());
    let noise = noise.map(|[gain, read]| Noise::Counts { light, gain, read });
    let bound = camera
        .zip(per_lenslet)
        .zip(noise)
        .and_then(|((camera, per_lenslet), noise)| bound(camera, per_lenslet, noise, [low, high]));
    let edges: Vec<f64> = (0..=SLABS).map(|n| low + (high - low) * n as f64 / SLABS as f64).collect();
    let slabs: Vec<Vec<&Particle>> = edges
        .windows(2)
        .map(|ends| all.iter().filter(|p| (ends[0]..ends[1]).contains(&p.place_mm[2])).collect())
        .collect();
    let middle = |n: usize| 0.5 * (edges[n] + edges[n + 1]);
    let mut counts = Panel::new("", Axis::new("z, mm"), Axis::new("particles a table"));
    counts.marks =
        vec![Mark::steps("", edges.clone(), slabs.iter().map(|slab| slab.len() as f64 / tables as f64).collect())];
    let mut panels = vec![counts];
    for axis in [0, 2] {
        let stated = |slab: &[&Particle]| {
            let mut stds: Vec<f64> = slab.iter().filter_map(|p| Some(p.uncertainty?.std_mm()[axis])).collect();
            if stds.is_empty() { f64::NAN } else { median(&mut stds) }
        };
        let points: Vec<[f64; 2]> = slabs.iter().enumerate().map(|(n, slab)| [middle(n), 1e3 * stated(slab)]).collect();
        if points.iter().all(|point| point[1].is_nan()) {
            continue;
        }
        let letter = ["x", "y", "z"][axis];
        let mut panel = Panel::new("", Axis::new("z, mm"), Axis::log(format!("uncertainty of {letter}, \u{b5}m")));
        panel.marks.push(Mark::line("stated, median", points));
        if let Some(bound) = &bound {
            let places = bound.by_depth.z_mm.iter().zip(&bound.by_depth.deviations.mm[axis]);
            let curve = places.map(|(z, value)| [*z, 1e3 * value.unwrap_or(f64::NAN)]);
            panel.marks.push(Mark::dashed("bound of any method", curve.collect()));
        }
        panels.push(panel);
    }
    let chart = Chart { title: "Particles by depth".into(), notes: Vec::new(), columns: 3, panels };
    section.chart(&chart, &caption(bound.is_some(), per_lenslet, noise));
    Some(section)
}

/// Particles for each lenslet that the sensor has.
fn density(camera: &Camera, particles: f64) -> f64 {
    let [width, height] = [camera.sensor.width, camera.sensor.height].map(|n| n as f64 * camera.sensor.pixel_pitch_mm);
    particles * camera.lattice().cell_area_mm2() / (width * height)
}

/// The Cramer-Rao bound of this camera, density and noise. None if it cannot be computed.
fn bound(camera: &Camera, per_lenslet: f64, noise: Noise, depth_mm: [f64; 2]) -> Option<Precision> {
    let experiment = Experiment {
        per_lenslet: per_lenslet.clamp(1e-3, 10.0),
        noise,
        sigma_px: SIGMA_PX,
        depth_mm,
        window_mm: WINDOW_PX * camera.pixel_in_focus_mm(),
        seed: 1,
    };
    precision(camera, &experiment).ok()
}

fn caption(has_bound: bool, per_lenslet: Option<f64>, noise: Option<Noise>) -> String {
    let stated = "Uncertainties are those that the tables state.";
    match (has_bound, per_lenslet, noise) {
        (true, Some(density), Some(Noise::Counts { light, gain, read })) => format!(
            "{stated} The bound is that of lf-validate precision for {density:.2} particles a lenslet of {light:.0} counts, \
             {gain:.3} counts an electron and a read noise of {read:.2} counts."
        ),
        _ => format!("{stated} Their bound needs a camera, and the noise that lf-fit found."),
    }
}
