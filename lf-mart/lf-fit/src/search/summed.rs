//! The particles whose waves at the rim of the stop the cameras hold, summed.

use crate::cameras::shape::{SHAPES, Shape};
use crate::particle::Particle;

/// Particles as they were when their waves were summed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Summed {
    list: Vec<Particle>,
    /// The shape of the first camera then. None before the first sum.
    shape: Option<Shape>,
}

/// Changes of the particles whose waves are summed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Difference {
    /// Whether the sum begins at zero.
    pub(crate) is_anew: bool,
    /// Particles to add. Those that leave the sum have negative light.
    pub(crate) particles: Vec<Particle>,
}

/// Waves of a particle stay in the sum up to a step of its place sideways and along z, pixels of the focal plane, and
/// of its light and size, shares of them; those of all up to a step of their shape, pixels.
const STAYS_PX: [f64; 3] = [0.02, 0.02, 0.2];
const STAYS_SHARE: f64 = 0.03;
const STAYS_SHAPE_PX: f64 = 0.01;

fn is_near(old: &Particle, new: &Particle, pixel_mm: f64) -> bool {
    (0..3).all(|axis| (old.place_mm[axis] - new.place_mm[axis]).abs() <= STAYS_PX[axis] * pixel_mm)
        && (old.light - new.light).abs() <= STAYS_SHARE * old.light.abs()
        && (old.log_size - new.log_size).abs() <= STAYS_SHARE
}

impl Summed {
    /// Forgets what was summed: the next sum begins at zero.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Takes other particles and says what leads to their sum. `pixel_mm` is that of the focal plane.
    pub(crate) fn follow(&mut self, list: &[Particle], shape: Shape, pixel_mm: f64) -> Difference {
        let is_same_shape = self.shape.is_some_and(|old| !old.is_beyond(&shape, [STAYS_SHAPE_PX; SHAPES]));
        let mut old = std::mem::take(&mut self.list);
        old.sort_by(|a, b| a.place_mm[0].total_cmp(&b.place_mm[0]));
        let mut stays = vec![false; old.len()];
        let mut particles = Vec::new();
        for particle in list {
            let first = old.partition_point(|one| one.place_mm[0] < particle.place_mm[0] - STAYS_PX[0] * pixel_mm);
            let near = (first..old.len())
                .take_while(|n| old[*n].place_mm[0] <= particle.place_mm[0] + STAYS_PX[0] * pixel_mm)
                .find(|n| !stays[*n] && is_near(&old[*n], particle, pixel_mm));
            match near {
                Some(n) => stays[n] = true,
                None => particles.push(*particle),
            }
        }
        let leaves = |one: &Particle| Particle { light: -one.light, ..*one };
        let stay = |does: bool| old.iter().zip(&stays).filter(move |(_, stays)| **stays == does).map(|(one, _)| one);
        let new = particles.len();
        particles.extend(stay(false).map(leaves));
        if !is_same_shape || particles.len() >= list.len() {
            *self = Self { list: list.to_vec(), shape: Some(shape) };
            return Difference { is_anew: true, particles: list.to_vec() };
        }
        self.list = stay(true).chain(&particles[..new]).copied().collect();
        Difference { is_anew: false, particles }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cameras::lens::LENSES;

    const SHAPE: Shape =
        Shape { sigma_px: 0.7, drift_px: [0.0; 2], blur_px: None, pattern: None, lens_px: [0.0; LENSES] };

    fn list(places: &[f64], light: f64) -> Vec<Particle> {
        places.iter().map(|x| Particle::new([*x, 0.0, 1.0], light)).collect()
    }

    #[test]
    fn a_sum_follows_by_hand() {
        let mut summed = Summed::default();
        let first = list(&[3.0, 1.0, 2.0, 0.0, 5.0], 100.0);
        let all = Difference { is_anew: true, particles: first.clone() };
        assert_eq!(summed.follow(&first, SHAPE, 1.0), all);
        assert_eq!(summed.follow(&first, SHAPE, 1.0), Difference { is_anew: false, particles: Vec::new() });
        // One moves by 0.05 px, another by 0.01.
        let second = list(&[3.05, 1.01, 2.0, 0.0, 5.0], 102.0);
        let particles = [list(&[3.05], 102.0), list(&[3.0], -100.0)].concat();
        assert_eq!(summed.follow(&second, SHAPE, 1.0), Difference { is_anew: false, particles });
        // Steps add up against what was summed, not against the last list.
        let third = list(&[3.05, 1.025, 2.0, 0.0, 5.0], 102.0);
        let particles = [list(&[1.025], 102.0), list(&[1.0], -100.0)].concat();
        assert_eq!(summed.follow(&third, SHAPE, 1.0), Difference { is_anew: false, particles });
        // All are new, or the shape is another.
        let fourth = list(&[7.0, 8.0, 9.0], 100.0);
        assert_eq!(summed.follow(&fourth, SHAPE, 1.0), Difference { is_anew: true, particles: fourth.clone() });
        let drifted = Shape { drift_px: [0.05, 0.0], ..SHAPE };
        assert_eq!(summed.follow(&fourth, drifted, 1.0), Difference { is_anew: true, particles: fourth.clone() });
    }

    #[test]
    fn two_particles_at_one_place_are_two() {
        let mut summed = Summed::default();
        let pair = list(&[1.0, 1.0, 4.0, 6.0], 50.0);
        summed.follow(&pair, SHAPE, 1.0);
        let particles = list(&[1.0], -50.0);
        assert_eq!(summed.follow(&pair[1..], SHAPE, 1.0), Difference { is_anew: false, particles });
    }
}
