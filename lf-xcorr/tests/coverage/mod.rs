//! The share of true errors that the stated uncertainties cover, on clouds of particles.
#![allow(dead_code)]

use crate::scene::{self, Wear};
use lf_core::field::MEASURED;
use lf_xcorr::{Options, correlate};
use std::f64::consts::TAU;
use std::ops::Range;

/// Voxels of the clouds, and their middle.
const SHAPE: [usize; 3] = [128, 128, 96];
const MIDDLE: [f64; 3] = [64.0, 64.0, 48.0];
/// The length, in voxels, that flows count in: the side of the usual window.
const WINDOW: f64 = 32.0;

/// A cloud of particles, and the windows that it is measured with.
#[derive(Clone, Copy)]
pub struct Cloud {
    /// Particles in 32 x 32 x 32 voxels.
    pub density: f64,
    pub sigma_vox: [f64; 3],
    pub wear: Wear,
    pub window: [usize; 3],
    pub overlap: f64,
}

impl Cloud {
    /// Particles of 0.75 voxel that do not change, in windows of 32 x 32 x 32 voxels at 75 % overlap.
    pub fn exact(density: f64) -> Self {
        Self { density, sigma_vox: [0.75; 3], wear: Wear::default(), window: [32; 3], overlap: 0.75 }
    }

    pub fn worn(density: f64) -> Self {
        Self { wear: WORN, ..Self::exact(density) }
    }
}

pub const WORN: Wear = Wear { jitter_vox: [0.1, 0.1, 0.2], lost: 0.1, flicker: 0.3 };

/// Displacements by their largest change, in voxels per 32 voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Flow {
    /// u rises along y and w along x.
    Shear(f64),
    /// A rotation of the whole volume about z.
    Rotation(f64),
    /// Vortices in x and y; their period in windows, and the change.
    Vortices(f64, f64),
    /// A wave of u along z; its period in windows, and the change.
    Wave(f64, f64),
    /// A jet along z with a Gaussian profile; its standard deviation in windows, and the change.
    Jet(f64, f64),
    /// A vortex ring about z; the standard deviation of its core in windows, and the change.
    Ring(f64, f64),
}

impl Flow {
    /// The flow in the words of a table.
    pub fn words(self) -> String {
        match self {
            Self::Shear(0.0) => "uniform".to_owned(),
            Self::Shear(change) => format!("shear, {change}"),
            Self::Rotation(change) => format!("rotation, {change}"),
            Self::Vortices(period, change) => format!("vortices of {period} w., {change}"),
            Self::Wave(period, change) => format!("wave of {period} w., {change}"),
            Self::Jet(width, change) => format!("jet of {width} w., {change}"),
            Self::Ring(core, change) => format!("ring of {core} w., {change}"),
        }
    }

    /// The displacement at a place, voxels.
    pub fn at(self, place: [f64; 3]) -> [f64; 3] {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|a| place[a] - MIDDLE[a]);
        match self {
            Self::Shear(change) => [1.3 + change / WINDOW * y, -0.6, 0.7 + change / WINDOW * x],
            Self::Rotation(change) => [0.4 - change / WINDOW * y, -0.6 + change / WINDOW * x, 0.7],
            Self::Vortices(period, change) => {
                let k = TAU / (WINDOW * period);
                let (height, [x, y, _]) = (change / WINDOW / k, place);
                [height * (k * x).sin() * (k * y).cos(), -height * (k * x).cos() * (k * y).sin(), 0.3]
            }
            Self::Wave(period, change) => {
                let k = TAU / (WINDOW * period);
                [change / WINDOW / k * (k * place[2]).sin(), 0.4, -0.2]
            }
            Self::Jet(width, change) => {
                let sigma = width * WINDOW;
                // The steepest slope of a Gaussian is exp(-1/2) of its height over its standard deviation.
                let height = change / WINDOW * sigma * 0.5f64.exp();
                [0.2, -0.3, height * (-0.5 * (x * x + y * y) / (sigma * sigma)).exp()]
            }
            Self::Ring(core, change) => {
                const RADIUS: f64 = 36.0;
                let (sigma, radius) = (core * WINDOW, x.hypot(y).max(1e-9));
                let (out, along) = (radius - RADIUS, z);
                // Solid rotation in the core, falling off as a Gaussian.
                let rate = change / WINDOW * (-0.5 * (out * out + along * along) / (sigma * sigma)).exp();
                let (radial, axial) = (-rate * along, rate * out);
                [radial * x / radius, radial * y / radius, axial]
            }
        }
    }
}

/// The largest displacement in the volume along each axis, voxels.
fn largest(flow: impl Fn([f64; 3]) -> [f64; 3]) -> [f64; 3] {
    let mut largest = [0.0f64; 3];
    let places = |axis: usize| (0..=16).map(move |k| k as f64 / 16.0 * SHAPE[axis] as f64);
    for (x, y) in places(0).flat_map(|x| places(1).map(move |y| (x, y))) {
        for shift in places(2).map(|z| flow([x, y, z])) {
            (0..3).for_each(|a| largest[a] = largest[a].max(shift[a].abs()));
        }
    }
    largest
}

/// Share of the errors of u, v, w that the stated standard uncertainty covers, and their root mean squares, voxels.
pub struct Coverage {
    pub share: [f64; 3],
    pub error_vox: [f64; 3],
    pub stated_vox: [f64; 3],
    /// Share of the vectors that are replaced or state no uncertainty.
    pub replaced: f64,
}

pub fn coverage(cloud: &Cloud, flow: impl Fn([f64; 3]) -> [f64; 3], seeds: Range<u64>) -> Coverage {
    let (mut all, mut count, mut covered, mut errors, mut stated) = (0.0, 0.0, [0.0; 3], [0.0; 3], [0.0; 3]);
    let search = largest(&flow).map(|shift| shift.ceil() as usize + 3);
    for seed in seeds {
        let grid = scene::grid(SHAPE);
        let density = cloud.density / WINDOW.powi(3);
        let [a, b] = scene::worn_pair(&grid, density, cloud.sigma_vox, seed, cloud.wear, &flow);
        let initial = [0, 1, 2].map(|a| (2 * cloud.window[a]).min(SHAPE[a]));
        let options = Options::coarse_to_fine(initial, cloud.window, cloud.overlap, search, Options::REFINE);
        let field = correlate(&a.sparse(), &b.sparse(), &options).unwrap().field;
        all += field.len() as f64;
        for i in (0..field.len()).filter(|&i| field.flag[i] == MEASURED && field.su[i].is_finite()) {
            count += 1.0;
            let wanted = flow(field.place_mm(i));
            let found = [(field.u[i], field.su[i]), (field.v[i], field.sv[i]), (field.w[i], field.sw[i])];
            for (axis, (value, uncertainty)) in found.into_iter().enumerate() {
                let error = (value as f64 - wanted[axis]).abs();
                covered[axis] += (error <= uncertainty as f64) as u8 as f64;
                errors[axis] += error * error;
                stated[axis] += (uncertainty as f64).powi(2);
            }
        }
    }
    let of = |sum: [f64; 3]| sum.map(|sum| sum / count);
    Coverage {
        share: of(covered),
        error_vox: of(errors).map(f64::sqrt),
        stated_vox: of(stated).map(f64::sqrt),
        replaced: 1.0 - count / all,
    }
}
