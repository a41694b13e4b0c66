//! Compares ways to make vectors of matched particles.
//!
//! `cargo bench -p lf-xcorr --bench pairs` reports root mean square errors in pixels and coverage by way and flow; `--
//! choose` runs the flows, densities and seeds that the way and its constants were chosen on. `-- full` times a full
//! frame: 60,000 particles and 74,000 windows.

#[path = "../tests/coverage/mod.rs"]
mod coverage;
#[path = "../tests/scene/mod.rs"]
mod scene;
#[path = "../tests/tracked/mod.rs"]
mod tracked;

use coverage::Flow;
use glam::{DMat3, DVec3};
use lf_core::field::{MEASURED, REPLACED};
use lf_core::{Field, Particle, VectorGrid};
use lf_xcorr::{Pair, Tracks, decide};
use std::ops::Range;
use std::time::Instant;
use tracked::{Errors, Lab, errors};

/// A weighted mean of the pairs of every window: weights are 3 x 3 matrices.
fn means(field: &Field, pairs: &[Pair], weight: impl Fn(&Pair) -> DMat3) -> Field {
    let mut found = field.clone();
    let half = 0.5 * DVec3::from(field.layout.voxel_mm) * DVec3::from_array(field.layout.window.map(|n| n as f64));
    for i in 0..field.len() {
        let centre = DVec3::from_array(field.place_mm(i));
        let inside = pairs.iter().filter(|pair| (pair.middle_mm - centre).abs().cmple(half).all());
        let (mut sum, mut pull, mut count) = (DMat3::ZERO, DVec3::ZERO, 0);
        for pair in inside {
            let weight = weight(pair);
            (sum, pull, count) = (sum + weight, pull + weight * pair.shift_mm, count + 1);
        }
        found.flag[i] = if count > 0 { MEASURED } else { REPLACED };
        if count > 0 {
            let inverse = sum.inverse();
            [found.u[i], found.v[i], found.w[i]] = (inverse * pull).as_vec3().to_array();
            [found.su[i], found.sv[i], found.sw[i]] = inverse.diagonal().map(f64::sqrt).as_vec3().to_array();
        }
    }
    found
}

fn line(flow: &str, density: f64, way: &str, all: &[Errors]) {
    let mean = |value: &dyn Fn(&Errors) -> f64| all.iter().map(value).sum::<f64>() / all.len() as f64;
    let rms = |value: &dyn Fn(&Errors) -> f64| mean(&|errors| value(errors).powi(2)).sqrt();
    println!(
        "{flow:22} {density:4} {way:22} {:7.3} {:7.3} {:7.3}  {:7.3} {:7.3}   {:3.0} {:3.0} {:3.0}  {:5.1}",
        rms(&|e| e.rms_px[0]),
        rms(&|e| e.rms_px[1]),
        rms(&|e| e.rms_px[2]),
        rms(&|e| e.near_px),
        rms(&|e| e.beyond_px),
        100.0 * mean(&|e| e.covered[0]),
        100.0 * mean(&|e| e.covered[1]),
        100.0 * mean(&|e| e.covered[2]),
        100.0 * mean(&|e| e.replaced)
    );
}

fn compare(flow: Flow, density: f64, seeds: Range<u64>) {
    const WAYS: [&str; 5] = ["correlation", "mean", "1 / variance", "full covariance", "decided"];
    let mut found: [Vec<Errors>; 5] = Default::default();
    for seed in seeds {
        let lab = Lab::new(flow, density, seed);
        let (field, [a, b]) = (lab.field(), lab.tables());
        let tables: [[&[Particle]; 2]; 1] = [[&a, &b]];
        let Tracks { field: best, pairs, .. } = decide(&field, &tables, &|_| true).expect("pairs are there");
        let variances = |pair: &Pair| DMat3::from_diagonal(pair.covariance_mm2.diagonal().map(f64::recip));
        let fields = [
            field.clone(),
            means(&field, &pairs, |_| DMat3::IDENTITY),
            means(&field, &pairs, variances),
            means(&field, &pairs, |pair| pair.covariance_mm2.inverse()),
            best,
        ];
        fields.iter().zip(&mut found).for_each(|(field, found)| found.push(errors(&lab, field)));
    }
    let name = flow.words();
    WAYS.iter().zip(&found).for_each(|(way, found)| line(&name, density, way, found));
}

/// Times a full frame of particles that move evenly.
fn full() {
    let lab = Lab::new(Flow::Shear(0.0), 0.4, 1);
    let [a, b] = lab.tables();
    let copies = 60_000 / a.len() + 1;
    let moved = |table: &[Particle]| -> Vec<Particle> {
        let place = |copy: usize| DVec3::new(3.7 * (copy % 6) as f64 - 9.25, 3.7 * (copy / 6) as f64 - 9.25, 0.0);
        let copy = |copy: usize| {
            table.iter().map(move |p| Particle { place_mm: (place(copy) + DVec3::from(p.place_mm)).into(), ..*p })
        };
        (0..copies).flat_map(copy).collect()
    };
    let [a, b] = [&a, &b].map(|table| moved(table));
    let layout = VectorGrid {
        shape: [42, 42, 42],
        spacing_mm: [0.5, 0.5, 0.22],
        origin_mm: [-10.25, -10.25, -4.5],
        window: [72, 72, 32],
        ..lab.field().layout
    };
    let mut field = Field::empty(layout);
    for i in 0..field.len() {
        let shift = lab.shift_mm(DVec3::ZERO).as_vec3();
        [field.u[i], field.v[i], field.w[i]] = shift.to_array();
        (field.su[i], field.sv[i], field.sw[i], field.flag[i]) = (0.002, 0.002, 0.02, MEASURED);
    }
    let start = Instant::now();
    let found = decide(&field, &[[&a, &b]], &|_| true).expect("pairs are there");
    let seconds = start.elapsed().as_secs_f64();
    println!("{} and {} particles, {} windows: {seconds:.1} s; {:?}", a.len(), b.len(), field.len(), found.report);
}

fn main() {
    let is_asked = |what: &str| std::env::args().any(|word| word == what);
    if is_asked("full") {
        return full();
    }
    println!(
        "{:27} {:22} {:>23}  {:>15}   {:11}  {:>5}",
        "flow", "way", "RMS u, v, w, px", "w focus, beyond", "covered, %", "repl."
    );
    let (flows, densities, seeds) = match is_asked("choose") {
        true => (
            vec![
                Flow::Shear(0.0),
                Flow::Wave(5.0, 4.0),
                Flow::Jet(3.0, 3.0),
                Flow::Jet(1.2, 3.0),
                Flow::Ring(0.8, 4.0),
            ],
            [0.3, 0.7],
            101..103,
        ),
        false => (
            vec![
                Flow::Shear(0.0),
                Flow::Shear(3.0),
                Flow::Rotation(4.0),
                Flow::Vortices(4.0, 3.0),
                Flow::Wave(6.0, 5.0),
                Flow::Jet(2.5, 4.0),
                Flow::Jet(0.9, 4.0),
                Flow::Ring(0.6, 3.0),
            ],
            [0.5, 1.0],
            1..4,
        ),
    };
    for density in densities {
        flows.iter().for_each(|flow| compare(*flow, density, seeds.clone()));
    }
}
