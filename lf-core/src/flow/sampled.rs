//! A velocity field given by the vectors of a file.

use crate::Refusal;
use crate::field::{Field, NO_DATA};
use glam::DVec3;

/// Displacements on a regular grid, trilinear between the vectors, constant beyond the outermost.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    shape: [usize; 3],
    spacing: DVec3,
    origin: DVec3,
    vectors: Vec<DVec3>,
}

impl Sampled {
    /// The displacements of a field. Refuses vectors without data.
    pub fn new(field: &Field) -> Result<Self, Refusal> {
        let missing = field.flag.iter().filter(|flag| **flag == NO_DATA).count();
        let found = || format!("{missing} of {} vectors are without data", field.len());
        Refusal::unless(missing == 0, found, "wanted a field without gaps")?;
        Ok(Self {
            shape: field.layout.shape,
            spacing: DVec3::from(field.layout.spacing_mm),
            origin: DVec3::from(field.layout.origin_mm),
            vectors: (0..field.len()).map(|i| field.displacement_mm(i)).collect(),
        })
    }

    pub(super) fn at(&self, place: DVec3) -> DVec3 {
        let steps = ((place - self.origin) / self.spacing).to_array();
        // Find the lower neighbour and the share of the upper one along each axis.
        let near: [(usize, f64); 3] = std::array::from_fn(|axis| {
            let last = (self.shape[axis] - 1) as f64;
            let step = steps[axis].clamp(0.0, last);
            let low = step.floor().min((last - 1.0).max(0.0));
            (low as usize, step - low)
        });
        let mut sum = DVec3::ZERO;
        for corner in 0..8 {
            let (mut index, mut weight, mut stride) = (0, 1.0, 1);
            for axis in 0..3 {
                let (low, share) = near[axis];
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { share } else { 1.0 - share };
                index += (low + upper).min(self.shape[axis] - 1) * stride;
                stride *= self.shape[axis];
            }
            sum += weight * self.vectors[index];
        }
        sum
    }
}
