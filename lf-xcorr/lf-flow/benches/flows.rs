//! How much lf-flow improves fields of divergence-free flows.
//!
//! `cargo bench -p lf-flow --bench flows` reports errors before and after and coverage, by flow and noise; `-- choose`
//! runs the flows, noises and seeds that constants were chosen on. `-- full` times a full field.

use glam::DVec3;
use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::flow::{Flows, Velocity};
use lf_core::{Field, VectorGrid};
use lf_flow::{Measured, derive, smooth, solenoidal};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use std::time::Instant;

/// A pixel, mm.
const PIXEL_MM: f64 = 0.0055;
/// Vectors a window covers along an axis: 75 % overlap.
const COVERED: usize = 4;
/// From one vector to the next, mm.
const SPACING: f64 = 0.22;

/// Errors of a particle's displacement.
#[derive(Clone, Copy)]
struct Noise {
    name: &'static str,
    /// Error of u and v, px.
    across_px: f64,
    /// Error of w over that of u, beyond the focus.
    depth: f64,
    /// How much larger the error of w is at the focus, and over which depth, mm.
    focus: (f64, f64),
    /// Share of vectors that are replaced, and of places without data.
    gaps: f64,
}

/// A particle in a window: its place from the window's centre, from -1 to 1 across, and what it says of the vector, px.
struct Particle {
    place: DVec3,
    /// Standard deviation of its displacement, px.
    scale: DVec3,
    displacement: DVec3,
}

/// The vector of a window by its particles, the square of its uncertainty by their scatter, and the square of the
/// flow's bend, less the part that scatter makes of it, as lf-xcorr takes it (`vectors/bend.rs`). px.
fn window(particles: &[Particle]) -> [DVec3; 3] {
    let weights: DVec3 = particles.iter().map(|p| (p.scale * p.scale).recip()).sum();
    let share = |p: &Particle| (p.scale * p.scale).recip() / weights;
    let mean: DVec3 = particles.iter().map(|p| share(p) * p.displacement).sum();
    let n = particles.len() as f64;
    let chi: DVec3 = particles.iter().map(|p| ((p.displacement - mean) / p.scale).powf(2.0)).sum();
    let bent = |p: &Particle| 3.75 * (1.0 - p.place.length_squared());
    let usual: DVec3 = particles.iter().map(|p| share(p) * bent(p)).sum();
    let parts = particles.iter().map(|p| (bent(p) - usual) * share(p) * (p.displacement - mean));
    let (bend, noise) =
        parts.fold((DVec3::ZERO, DVec3::ZERO), |(sum, square), part| (sum + part, square + part * part));
    [mean, chi / (n - 1.0) / weights, bend * bend - n / (n - 1.0) * noise]
}

/// Errors of the particles of a field, in the cells between its vectors: place in the cell, standard deviation, px, and
/// error in it. Ten are in a window.
fn seeded(layout: &VectorGrid, noise: &Noise, random: &mut Pcg64Mcg) -> (Vec<Vec<[DVec3; 3]>>, [usize; 3]) {
    let cells = layout.shape.map(|n| n + COVERED);
    let count = 10 * cells.iter().product::<usize>() / COVERED.pow(3);
    let mut held = vec![Vec::new(); cells.iter().product()];
    for _ in 0..count {
        let cell = cells.map(|n| random.random_range(0..n));
        let inside = DVec3::from(std::array::from_fn::<f64, 3, _>(|_| random.random()));
        let depth = layout.origin_mm[2] + (cell[2] as f64 + inside.z - 2.0) * layout.spacing_mm[2];
        let near = 1.0 + (noise.focus.0 - 1.0) * (-(depth / noise.focus.1).powi(2)).exp();
        let error = DVec3::from(std::array::from_fn::<f64, 3, _>(|_| StandardNormal.sample(random)));
        let scale = DVec3::new(1.0, 1.0, noise.depth * near) * noise.across_px * 10f64.sqrt();
        held[cell[0] + cells[0] * (cell[1] + cells[1] * cell[2])].push([inside, scale, error]);
    }
    (held, cells)
}

/// The true field, and one whose vectors are means of the particles in their windows, laid on each other by the flow's
/// gradient. Uncertainties are stated as lf-xcorr states them: scatter, and the bend of the flow inside a window.
fn measure(flow: &Velocity, shape: [usize; 3], noise: &Noise, seed: u64) -> (Field, Field) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let layout = VectorGrid {
        shape,
        spacing_mm: [SPACING; 3],
        origin_mm: shape.map(|n| -0.5 * (n - 1) as f64 * SPACING),
        voxel_mm: [PIXEL_MM; 3],
        window: [(COVERED as f64 * SPACING / PIXEL_MM) as usize; 3],
        overlap: 0.75,
        dt_s: None,
        history: Vec::new(),
    };
    let at = |place: DVec3| flow.displacement_mm(place, 1.0) / PIXEL_MM;
    let mut truth = Field::empty(layout.clone());
    truth.flag.fill(MEASURED);
    let mut field = truth.clone();
    let (held, cells) = seeded(&layout, noise, &mut random);
    let half = 0.5 * COVERED as f64 * SPACING;
    let found: Vec<[DVec3; 3]> = (0..field.len())
        .map(|i| {
            let centre = DVec3::from(truth.place_mm(i));
            let slopes = [DVec3::X, DVec3::Y, DVec3::Z]
                .map(|axis| (at(centre + SPACING * axis) - at(centre - SPACING * axis)) / (2.0 * SPACING) * half);
            let [x, y, z] = [i % shape[0], i / shape[0] % shape[1], i / shape[0] / shape[1]];
            let mut particles = Vec::new();
            for n in 0..COVERED.pow(3) {
                let [a, b, c] = [n % COVERED, n / COVERED % COVERED, n / COVERED / COVERED];
                let cell = DVec3::new(a as f64, b as f64, c as f64);
                for [inside, scale, error] in &held[x + a + cells[0] * (y + b + cells[1] * (z + c))] {
                    let place = (cell + *inside) / (0.5 * COVERED as f64) - 1.0;
                    let linear = slopes[0] * place.x + slopes[1] * place.y + slopes[2] * place.z;
                    let displacement = at(centre + half * place) - linear + *error * *scale;
                    particles.push(Particle { place, scale: *scale, displacement });
                }
            }
            field.count[i] = particles.len() as f32;
            [truth.u[i], truth.v[i], truth.w[i]] = (PIXEL_MM * at(centre)).as_vec3().to_array();
            if particles.len() < 3 { [DVec3::NAN; 3] } else { window(&particles) }
        })
        .collect();
    let bends = neighbours(&found.iter().map(|[.., bend]| *bend).collect::<Vec<_>>(), shape);
    for (i, [mean, variance, _]) in found.into_iter().enumerate() {
        [field.u[i], field.v[i], field.w[i]] = (PIXEL_MM * mean).as_vec3().to_array();
        let sigma = PIXEL_MM * (variance + 1.5 * bends[i].max(DVec3::ZERO)).powf(0.5);
        [field.su[i], field.sv[i], field.sw[i]] = sigma.as_vec3().to_array();
        if mean.is_nan() || random.random::<f64>() < noise.gaps {
            let is_dark = random.random::<bool>();
            field.flag[i] = if is_dark { NO_DATA } else { REPLACED };
            [field.su[i], field.sv[i], field.sw[i]] = [f32::NAN; 3];
            if is_dark || mean.is_nan() {
                [field.u[i], field.v[i], field.w[i]] = [0.0; 3];
            }
        }
    }
    (truth, field)
}

/// Means of the known values within two vectors of each along x, y, z.
fn neighbours(values: &[DVec3], [nx, ny, nz]: [usize; 3]) -> Vec<DVec3> {
    let near = |at: usize, count: usize| at.saturating_sub(2)..(at + 3).min(count);
    let mean = |i: usize| {
        let [x, y, z] = [i % nx, i / nx % ny, i / nx / ny];
        let rows = near(z, nz).flat_map(|z| near(y, ny).map(move |y| nx * (y + ny * z)));
        let all = rows.flat_map(|row| values[row + near(x, nx).start..row + near(x, nx).end].iter());
        let (sum, count) = all.filter(|value| !value.is_nan()).fold((DVec3::ZERO, 0.0), |(s, n), v| (s + *v, n + 1.0));
        sum / f64::max(count, 1.0)
    };
    (0..values.len()).map(mean).collect()
}

/// RMS errors of u, v, w in px, and the share that the uncertainties cover, over the vectors that were measured.
#[derive(Default, Clone, Copy)]
struct Score {
    rms: [f64; 3],
    covered: [f64; 3],
}

fn score(truth: &Field, field: &Field, measured: &Field) -> Score {
    let mut score = Score::default();
    let known: Vec<usize> = (0..field.len()).filter(|i| measured.flag[*i] == MEASURED).collect();
    for c in 0..3 {
        let error = |i: usize| (field.displacement_mm(i) - truth.displacement_mm(i))[c];
        let squares: f64 = known.iter().map(|i| error(*i).powi(2)).sum();
        score.rms[c] = (squares / known.len() as f64).sqrt() / PIXEL_MM;
        let inside = known.iter().filter(|i| error(**i).abs() <= field.uncertainty_mm(**i)[c]).count();
        score.covered[c] = inside as f64 / known.len() as f64;
    }
    score
}

fn mean(scores: &[Score]) -> Score {
    let n = scores.len() as f64;
    Score {
        rms: [0, 1, 2].map(|c| (scores.iter().map(|score| score.rms[c].powi(2)).sum::<f64>() / n).sqrt()),
        covered: [0, 1, 2].map(|c| scores.iter().map(|score| score.covered[c]).sum::<f64>() / n),
    }
}

fn flow(text: &str) -> Velocity {
    let flows: Flows = serde_json::from_str(text).expect("a flow");
    flows.velocity(Vec::new(), [[-3.0, 3.0], [-3.0, 3.0], [-2.0, 2.0]], PIXEL_MM)
}

fn compare(name: &str, text: &str, shape: [usize; 3], noise: &Noise, seeds: std::ops::Range<u64>) {
    let flow = flow(text);
    let mut found: [Vec<Score>; 4] = Default::default();
    let (mut divergence, mut misfit) = ([0.0f64; 2], 0.0f64);
    for seed in seeds.clone() {
        let (truth, field) = measure(&flow, shape, noise, seed);
        let measured = Measured::new(&field, None).expect("a field");
        let free = solenoidal(&field, &measured);
        divergence = [divergence[0] + derive(&field).divergence[0], divergence[1] + derive(&free.field).divergence[0]];
        misfit += free.misfit;
        let smoothed = smooth(&field, &measured, None);
        let freed = Measured::new(&smoothed.field, None).expect("a field");
        let both = solenoidal(&smoothed.field, &freed);
        let fields = [&field, &free.field, &smoothed.field, &both.field];
        fields.iter().zip(&mut found).for_each(|(one, found)| found.push(score(&truth, one, &field)));
    }
    let n = (seeds.end - seeds.start) as f64;
    for (way, scores) in ["measured", "solenoidal", "smooth", "smooth, solenoidal"].iter().zip(&found) {
        let (Score { rms, covered }, before) = (mean(scores), mean(&found[0]));
        let change = [0, 1, 2].map(|c| 100.0 * (rms[c] / before.rms[c] - 1.0));
        let [a, b, c] = covered.map(|share| 100.0 * share);
        println!(
            "{name:14} {:8} {way:19} {:6.3} {:6.3} {:6.3}  {:5.0} {:5.0} {:5.0}   {a:3.0} {b:3.0} {c:3.0}",
            noise.name, rms[0], rms[1], rms[2], change[0], change[1], change[2]
        );
    }
    println!(
        "{:24}divergence RMS {:.1e} before, {:.1e} after; misfit {:.2}",
        "",
        divergence[0] / n,
        divergence[1] / n,
        misfit / n
    );
}

/// Flows by name.
type Named = (&'static str, &'static str);

/// Flows, noises and seeds on which constants were chosen.
const CHOICE: [Named; 4] = [
    ("taylor-green 7", r#"{"kind": "taylor-green", "wavelength_mm": 7, "displacement_mm": 0.02}"#),
    ("abc 9", r#"{"kind": "abc", "wavelength_mm": 9, "displacement_mm": [0.01, 0.02, 0.015]}"#),
    (
        "jet 2.4",
        r#"{"kind": "jet", "axis": [0.2, 0.1, 1], "diameter_mm": 2.4, "shear_layer_mm": 0.35,
            "displacement_mm": 0.022}"#,
    ),
    ("ring 1.5", r#"{"kind": "ring", "axis": [0, 1, 0.3], "radius_mm": 1.5, "core_mm": 0.7, "displacement_mm": 0.02}"#),
];

/// Flows that are reported.
const REPORT: [Named; 4] = [
    ("taylor-green 6", r#"{"kind": "taylor-green", "wavelength_mm": 6, "displacement_mm": 0.025}"#),
    ("abc 6", r#"{"kind": "abc", "wavelength_mm": 6, "displacement_mm": [0.02, 0.01, 0.015]}"#),
    (
        "jet 2",
        r#"{"kind": "jet", "axis": [0.1, 1, 0.4], "diameter_mm": 2, "shear_layer_mm": 0.3,
            "displacement_mm": 0.025}"#,
    ),
    (
        "ring 1.2",
        r#"{"kind": "ring", "axis": [0.2, 0.3, 1], "radius_mm": 1.2, "core_mm": 0.6, "displacement_mm": 0.025}"#,
    ),
];

/// The time that a full field takes, 42 x 42 x 42 vectors.
fn time() {
    let noise = Noise { name: "", across_px: 0.1, depth: 10.0, focus: (3.0, 0.8), gaps: 0.03 };
    let (_, field) = measure(&flow(CHOICE[1].1), [42; 3], &noise, 1);
    let begun = Instant::now();
    let measured = Measured::new(&field, None).expect("a field");
    println!("{} vectors: fill {:.2} s", field.len(), begun.elapsed().as_secs_f64());
    let begun = Instant::now();
    let found = solenoidal(&field, &measured);
    println!("solenoidal {:.2} s, {} steps", begun.elapsed().as_secs_f64(), found.steps);
    let begun = Instant::now();
    let found = smooth(&field, &measured, None);
    println!("smooth {:.2} s, strengths {:?}", begun.elapsed().as_secs_f64(), found.strength);
    let begun = Instant::now();
    derive(&field);
    println!("derive {:.2} s", begun.elapsed().as_secs_f64());
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let is = |word: &str| words.iter().any(|w| w == word);
    if is("full") {
        return time();
    }
    let noise = |name, across_px, depth, focus, gaps| Noise { name, across_px, depth, focus, gaps };
    println!("flow           noise    way                   RMS u, v, w, px     change, %          covered, %");
    let (flows, noises, shape, seeds) = if is("choose") {
        let noises = vec![noise("w 8", 0.15, 8.0, (2.5, 0.6), 0.02), noise("w 16", 0.08, 16.0, (1.5, 1.0), 0.05)];
        (CHOICE, noises, [25, 25, 17], 0..2)
    } else {
        let [five, ten, twenty] = [("w 5", 5.0, (2.0, 0.7)), ("w 10", 10.0, (3.0, 0.5)), ("w 20", 20.0, (2.0, 1.0))]
            .map(|(name, depth, focus)| noise(name, 0.1, depth, focus, 0.03));
        (REPORT, vec![five, ten, twenty], [28, 24, 16], 10..13)
    };
    for (name, text) in flows {
        noises.iter().for_each(|noise| compare(name, text, shape, noise, seeds.clone()));
    }
}
