//! Fields for the tests of this crate.

use lf_core::{Field, VectorGrid, field::MEASURED};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// A field of `shape` measured vectors. `vector` gives the displacement at a place, both in mm.
pub(crate) fn field(shape: [usize; 3], vector: impl Fn([f64; 3]) -> [f64; 3]) -> Field {
    let layout = VectorGrid {
        shape,
        spacing_mm: [0.5, 0.25, 2.0],
        origin_mm: [-1.0, 0.5, -3.0],
        voxel_mm: [0.01, 0.02, 0.1],
        window: [0; 3],
        overlap: 0.0,
        dt_s: None,
        history: Vec::new(),
    };
    let mut field = Field::empty(layout);
    field.flag.fill(MEASURED);
    for at in 0..field.len() {
        [field.u[at], field.v[at], field.w[at]] = vector(field.place_mm(at)).map(|component| component as f32);
    }
    field
}

/// A flow that trilinear interpolation reproduces exactly.
pub(crate) fn trilinear([x, y, z]: [f64; 3]) -> [f64; 3] {
    [0.1 + 0.2 * x - 0.3 * y + 0.05 * z, x * y - 0.1 * z, x * y * z]
}

/// Adds independent normal errors to every vector.
pub(crate) fn disturb(field: &mut Field, sigma_mm: [f64; 3], seed: u64) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    for (component, sigma) in [&mut field.u, &mut field.v, &mut field.w].into_iter().zip(sigma_mm) {
        for value in component {
            let normal: f64 = StandardNormal.sample(&mut random);
            *value += (sigma * normal) as f32;
        }
    }
}
