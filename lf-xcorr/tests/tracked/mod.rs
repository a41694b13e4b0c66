//! Particles as a plenoptic camera knows them, in two frames of a flow, and a field that predicts as a correlation
//! does.
//!
//! The covariances are the Cramer-Rao bounds of single particles behind a thin lens with a square stop (f/4, m = 1) and
//! a square lattice in line: exact light of a Gaussian particle per lenslet and pixel. The light of a particle is a
//! product of one function along x and one along y, so tables of one axis give all four by four Fisher terms.
#![allow(dead_code)]

use crate::coverage::Flow;
use glam::{DMat3, DMat4, DVec3, DVec4};
use lf_core::particles::Uncertainty;
use lf_core::{Field, Particle, VectorGrid, field::MEASURED};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::OnceLock;

/// Pixel at the focal plane, mm.
pub const PX: f64 = 0.0055;
/// Voxel of the predicting field, mm: its windows of 32 voxels are 0.88 mm long.
const VOXEL_MM: f64 = 0.0275;
/// Windows of the field along each axis, and where the flow's own voxel (64, 64, 48) is.
const SHAPE: [usize; 3] = [13, 13, 42];
const MIDDLE_VOX: DVec3 = DVec3::new(64.0, 64.0, 48.0);
/// Half the volume that is seeded, mm.
const HALF_MM: DVec3 = DVec3::new(1.85, 1.85, 5.2);

/// Pixels of a line, and lenslets beside the middle that a particle may light.
const LINE: usize = 14 * 40;
const PITCH: f64 = 0.077;

/// Light of a particle at (x, z) mm along one axis, per pixel.
fn profile(x: f64, z: f64) -> Vec<f64> {
    const F: f64 = 200.0;
    const GAP: f64 = 0.308;
    // Gauss-Hermite nodes and weights of a standard normal distribution.
    const NODES: [(f64, f64); 4] = [
        (0.0, 0.457_142_857),
        (1.154_405_395, 0.240_123_178),
        (2.366_759_410, 0.030_757_124),
        (3.750_439_718, 0.000_548_269),
    ];
    let (image, object) = (2.0 * F, 2.0 * F);
    let (aperture, k) = (image / 4.0, GAP / image);
    let beta = image / (object - z);
    let alpha = 1.0 - image / F + beta;
    let gain = k * (alpha - 1.0);
    let mut line = vec![0.0; LINE];
    let signed = NODES.iter().flat_map(|&(t, w)| if t == 0.0 { vec![(t, w)] } else { vec![(-t, w), (t, w)] });
    for (t, weight) in signed {
        let centre = -beta * (x + 0.75 * PX * t);
        let reach = alpha.abs() * 0.5 * aperture + PITCH;
        let lenslets = ((centre - reach) / PITCH).floor() as i64..=((centre + reach) / PITCH).ceil() as i64;
        for lenslet in lenslets {
            let c = lenslet as f64 * PITCH;
            let (mut low, mut high) = (-0.5 * aperture, 0.5 * aperture);
            if alpha.abs() < 1e-9 {
                if (centre - c).abs() > 0.5 * PITCH {
                    continue;
                }
            } else {
                let edges = [-0.5, 0.5].map(|side| (c + side * PITCH - centre) / alpha);
                (low, high) = (low.max(edges[0].min(edges[1])), high.min(edges[0].max(edges[1])));
            }
            let first = (c * (1.0 + k) / PX).round() as i64 - 9;
            for pixel in first..first + 18 {
                let rays = [0.0, 1.0].map(|edge| ((pixel as f64 + edge) * PX - c - k * centre) / gain);
                let light = high.min(rays[0].max(rays[1])) - low.max(rays[0].min(rays[1]));
                if let Some(sum) = usize::try_from(pixel + LINE as i64 / 2).ok().and_then(|n| line.get_mut(n)) {
                    *sum += weight * light.max(0.0) / aperture;
                }
            }
        }
    }
    line
}

/// Sums of products of the profile and its derivatives along x and z: 00, 0x, 0z, xx, xz, zz.
fn products(x: f64, z: f64) -> [f64; 6] {
    const STEP: [f64; 2] = [2e-4, 2e-3];
    let slope = |dx: f64, dz: f64| -> Vec<f64> {
        let [above, below] = [1.0, -1.0].map(|side| profile(x + side * dx, z + side * dz));
        above.iter().zip(below).map(|(a, b)| (a - b) / (2.0 * (dx + dz))).collect()
    };
    let all = [profile(x, z), slope(STEP[0], 0.0), slope(0.0, STEP[1])];
    let sum = |a: usize, b: usize| all[a].iter().zip(&all[b]).map(|(a, b)| a * b).sum();
    [sum(0, 0), sum(0, 1), sum(0, 2), sum(1, 1), sum(1, 2), sum(2, 2)]
}

const PHASES: usize = 26;
const DEPTHS: usize = 105;

/// Depth of a row of the table, mm: fine near the focal plane.
fn depth(row: usize) -> f64 {
    if row < 60 { 0.02 * row as f64 } else { 1.2 + 0.1 * (row - 60) as f64 }
}

fn table() -> &'static Vec<[f64; 6]> {
    static TABLE: OnceLock<Vec<[f64; 6]>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let at = |n: usize| products(PITCH * ((n % PHASES) as f64 + 0.5) / PHASES as f64, depth(n / PHASES));
        (0..PHASES * DEPTHS).map(at).collect()
    })
}

/// Products at a place; behind the focal plane those with z change their sign.
fn at(x: f64, z: f64) -> [f64; 6] {
    let phase = (x.rem_euclid(PITCH) / PITCH * PHASES as f64) as usize % PHASES;
    let row = (0..DEPTHS - 1).rev().find(|row| depth(*row) <= z.abs()).unwrap_or(0);
    let share = ((z.abs() - depth(row)) / (depth(row + 1) - depth(row))).clamp(0.0, 1.0);
    let sign = [1.0, 1.0, z.signum(), 1.0, z.signum(), 1.0];
    let [low, high] = [row, row + 1].map(|row| table()[phase + PHASES * row]);
    std::array::from_fn(|n| sign[n] * (low[n] + share * (high[n] - low[n])))
}

/// How uncertain a particle of unit light is, by the noise of a pixel. Places are known to a lenslet, depths to 0.3 mm.
fn bound(place: DVec3, noise: f64) -> Uncertainty {
    let [a, ax, az, axx, axz, azz] = at(place.x, place.z);
    let [b, by, bz, byy, byz, bzz] = at(place.y, place.z);
    let x = DVec4::new(axx * b, ax * by, axz * b + ax * bz, ax * b);
    let y = DVec4::new(x.y, a * byy, a * byz + az * by, a * by);
    let z = DVec4::new(x.z, y.z, azz * b + 2.0 * az * bz + a * bzz, az * b + a * bz);
    let light = DVec4::new(x.w, y.w, z.w, a * b);
    let known = DVec4::new(0.022f64.powi(-2), 0.022f64.powi(-2), 0.3f64.powi(-2), 0.0);
    let fisher = DMat4::from_cols(x, y, z, light) * (noise * noise).recip() + DMat4::from_diagonal(known);
    let covariance = fisher.inverse();
    Uncertainty { covariance_mm2: DMat3::from_mat4(covariance), intensity: covariance.w_axis.w.sqrt() }
}

/// A flow, particles in it, and how well they are found.
#[derive(Clone, Copy)]
pub struct Lab {
    pub flow: Flow,
    /// Particles per lenslet.
    pub density: f64,
    pub seed: u64,
    /// Stated uncertainties over the true ones.
    pub stated: f64,
}

impl Lab {
    pub fn new(flow: Flow, density: f64, seed: u64) -> Self {
        Self { flow, density, seed, stated: 1.0 }
    }

    /// The displacement at a place, mm.
    pub fn shift_mm(&self, place_mm: DVec3) -> DVec3 {
        let place_vox = place_mm / VOXEL_MM + MIDDLE_VOX;
        VOXEL_MM * DVec3::from_array(self.flow.at(place_vox.to_array()))
    }

    /// The particles found in both frames. One of fifty is missed, and one of fifty is a ghost. `id` is the true
    /// number.
    pub fn tables(&self) -> [Vec<Particle>; 2] {
        let mut random = Pcg64Mcg::seed_from_u64(self.seed);
        let lenslets = 4.0 * HALF_MM.x * HALF_MM.y / (PITCH * PITCH);
        let count = (self.density * lenslets * HALF_MM.z / 5.0) as u64;
        // Overlapping images leave less light that is sure: the noise that gives the bounds of dense clouds.
        let noise = 0.00036 * self.density.powf(0.36) * self.stated.recip();
        let mut tables = [Vec::new(), Vec::new()];
        for id in 0..count {
            let middle = HALF_MM * DVec3::from_array([(); 3].map(|()| 2.0 * random.random::<f64>() - 1.0));
            let half = 0.5 * self.shift_mm(middle);
            let brightness = 1000.0 * (0.3 * normal(&mut random)).exp();
            for (frame, table) in tables.iter_mut().enumerate() {
                let mut found = self.found(middle + (2.0 * frame as f64 - 1.0) * half, noise, &mut random);
                (found.frame, found.id, found.intensity) = (frame, id, found.intensity * brightness);
                found.uncertainty = found.uncertainty.map(|u| Uncertainty { intensity: u.intensity * brightness, ..u });
                let chance = random.random::<f64>();
                if chance > 0.02 {
                    table.push(found);
                }
                if chance > 0.98 {
                    let ghost = HALF_MM * DVec3::from_array([(); 3].map(|()| 2.0 * random.random::<f64>() - 1.0));
                    table.push(Particle { id: count + 2 * id + frame as u64, place_mm: ghost.into(), ..found });
                }
            }
        }
        tables
    }

    /// A particle at a place, found with the noise that it states.
    fn found(&self, place: DVec3, noise: f64, random: &mut Pcg64Mcg) -> Particle {
        let uncertainty = bound(place, noise);
        let covariance = uncertainty.covariance_mm2;
        let error = cholesky(covariance) * DVec3::from_array([(); 3].map(|()| normal(random)));
        Particle {
            frame: 0,
            id: 0,
            place_mm: (place + error).into(),
            intensity: (1.0 + uncertainty.intensity * normal(random)).max(0.1),
            uncertainty: Some(Uncertainty {
                covariance_mm2: covariance * (self.stated * self.stated),
                intensity: uncertainty.intensity * self.stated,
            }),
        }
    }

    /// The field of a correlation: the flow with errors that windows share, near the focal plane large along z, and
    /// stated uncertainties that cover half of them.
    pub fn field(&self) -> Field {
        let spacing = 8.0 * VOXEL_MM;
        let mut field = Field::empty(VectorGrid {
            shape: SHAPE,
            spacing_mm: [spacing; 3],
            origin_mm: SHAPE.map(|n| -0.5 * (n - 1) as f64 * spacing),
            voxel_mm: [VOXEL_MM; 3],
            window: [32; 3],
            overlap: 0.75,
            ..VectorGrid::default()
        });
        let mut random = Pcg64Mcg::seed_from_u64(self.seed ^ 0xf1e1d);
        let rough: Vec<DVec3> =
            (0..field.len()).map(|_| DVec3::from_array([(); 3].map(|()| normal(&mut random)))).collect();
        let [nx, ny, _] = SHAPE;
        for i in 0..field.len() {
            let place = DVec3::from_array(field.place_mm(i));
            let w = if place.z.abs() < 0.9 { 4.0 } else { 0.8 };
            let error = PX * DVec3::new(0.15, 0.15, w);
            // Neighbours share their error, two and two.
            let [x, y, z] = [i % nx, i / nx % ny, i / nx / ny].map(|step| step / 2 * 2);
            let shift = self.shift_mm(place) + error * rough[x + nx * (y + ny * z)];
            [field.u[i], field.v[i], field.w[i]] = shift.as_vec3().to_array();
            [field.su[i], field.sv[i], field.sw[i]] = (0.7 * error).as_vec3().to_array();
            (field.flag[i], field.peak[i], field.ratio[i]) = (MEASURED, 0.8, 2.0);
        }
        field
    }
}

fn normal(random: &mut Pcg64Mcg) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// Lower factor of a covariance.
fn cholesky(m: DMat3) -> DMat3 {
    let a = m.x_axis.x.sqrt();
    let (b, c) = (m.x_axis.y / a, m.x_axis.z / a);
    let d = (m.y_axis.y - b * b).max(0.0).sqrt();
    let e = (m.y_axis.z - b * c) / d.max(f64::MIN_POSITIVE);
    let f = (m.z_axis.z - c * c - e * e).max(0.0).sqrt();
    DMat3::from_cols(DVec3::new(a, b, c), DVec3::new(0.0, d, e), DVec3::new(0.0, 0.0, f))
}

/// Errors of a field in pixels: root mean squares of u, v, w, of w within 0.9 mm of the focal plane and beyond, share
/// within one stated uncertainty, share replaced. Windows within half a window of the sides of the seeded volume are
/// left out.
pub struct Errors {
    pub rms_px: [f64; 3],
    pub near_px: f64,
    pub beyond_px: f64,
    pub covered: [f64; 3],
    pub replaced: f64,
}

pub fn errors(lab: &Lab, field: &Field) -> Errors {
    let (mut all, mut squares, mut near, mut beyond) = (0.0, [0.0; 3], [0.0; 2], [0.0; 2]);
    let (mut measured, mut covered) = (0.0, [0.0; 3]);
    for i in 0..field.len() {
        let place = DVec3::from_array(field.place_mm(i));
        if place.x.abs().max(place.y.abs()) > HALF_MM.x - 0.44 {
            continue;
        }
        let error = ((field.displacement_mm(i) - lab.shift_mm(place)) / PX).to_array();
        all += 1.0;
        (0..3).for_each(|c| squares[c] += error[c] * error[c]);
        let depth = if place.z.abs() <= 0.9 { &mut near } else { &mut beyond };
        (depth[0], depth[1]) = (depth[0] + 1.0, depth[1] + error[2] * error[2]);
        if field.flag[i] == MEASURED {
            measured += 1.0;
            let stated = (field.uncertainty_mm(i) / PX).to_array();
            (0..3).for_each(|c| covered[c] += (error[c].abs() <= stated[c]) as u8 as f64);
        }
    }
    Errors {
        rms_px: squares.map(|sum| (sum / all).sqrt()),
        near_px: (near[1] / near[0]).sqrt(),
        beyond_px: (beyond[1] / beyond[0]).sqrt(),
        covered: covered.map(|sum| sum / measured),
        replaced: 1.0 - measured / all,
    }
}
