//! Particles that pile up at an end of the depths: what lies beyond it is pressed into the last slices.

use crate::cameras::view::BEYOND_PX;
use crate::stages::Fit;
use lf_core::statistics::median;

/// Number of slabs of equal thickness that the depths are cut into.
const SLABS: usize = 20;
/// A slab at the end has too many particles if it has more than this many times the usual number, and this many more.
/// Good frames whose particles end with the depths have up to 1.5 times.
const TIMES: f64 = 2.0;
const MORE: f64 = 10.0;

/// Too many particles at one end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PiledUp {
    /// Depth of the end, mm.
    pub end_mm: f64,
    /// Particles in the slab there.
    pub count: usize,
    /// Particles in the median slab.
    pub usual: f64,
}

impl Fit<'_> {
    /// The ends of the first camera's depths at which particles pile up.
    pub fn piled_up(&self) -> Vec<PiledUp> {
        let view = &self.cameras[0];
        let beyond = BEYOND_PX * view.pixel_mm;
        let [low, high] = [view.depth_mm[0] + beyond, view.depth_mm[1] - beyond];
        piled_up(self.particles.iter().map(|found| found.particle.place_mm[2]), [low, high])
    }
}

fn piled_up(depths_mm: impl Iterator<Item = f64>, [low, high]: [f64; 2]) -> Vec<PiledUp> {
    let mut counts = [0.0; SLABS];
    for z in depths_mm {
        // The last slab takes in those that left the depths.
        let slab = (z - low) / (high - low) * SLABS as f64;
        counts[slab.clamp(0.0, SLABS as f64 - 1.0) as usize] += 1.0;
    }
    let usual = median(&mut counts.clone());
    let ends = [(low, counts[0]), (high, counts[SLABS - 1])].into_iter();
    let piled = ends.filter(|(_, count)| *count > TIMES * usual + MORE);
    piled.map(|(end_mm, count)| PiledUp { end_mm, count: count as usize, usual }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pile_at_an_end_is_counted() {
        let even: Vec<f64> = (0..200).map(|n| -4.975 + 0.05 * f64::from(n)).collect();
        let count =
            |more: usize, z: f64| piled_up(even.iter().copied().chain(std::iter::repeat_n(z, more)), [-5.0, 5.0]);
        // Ten a slab: 30 are not too many, 31 are. Particles beyond the end count there; those inside never do.
        assert!(count(20, 5.1).is_empty() && count(100, 0.0).is_empty());
        assert_eq!(count(21, 5.1), [PiledUp { end_mm: 5.0, count: 31, usual: 10.0 }]);
        assert_eq!(count(21, -5.0), [PiledUp { end_mm: -5.0, count: 31, usual: 10.0 }]);
        assert!(piled_up(std::iter::empty(), [-5.0, 5.0]).is_empty());
    }
}
