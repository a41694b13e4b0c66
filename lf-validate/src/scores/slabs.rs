//! The distances from the focal plane between which particles are scored apart: `--depths`.

use lf_core::{Particle, Refusal};

/// The `typed` distances, or the usual ones, mm: divided by ten as long as a tenth holds all particles, as before a
/// microscope, and then on by doubling to the farthest.
pub fn slabs(typed: Option<&[f64]>, usual: &[f64], particles: &[Particle]) -> Result<Vec<f64>, Refusal> {
    if let Some(depths) = typed {
        if !depths.is_sorted_by(|a, b| a < b) || depths[0] < 0.0 {
            let typed: Vec<String> = depths.iter().map(f64::to_string).collect();
            return Err(Refusal::new(typed.join(","), "wanted rising distances from 0"));
        }
        return Ok(depths.to_vec());
    }
    let farthest = particles.iter().map(|particle| particle.place_mm[2].abs()).fold(0.0, f64::max);
    let mut depths = usual.to_vec();
    while farthest > 0.0 && depths.last().is_some_and(|last| 10.0 * farthest <= *last) {
        depths.iter_mut().for_each(|depth| *depth /= 10.0);
    }
    while let Some(last) = depths.last().copied().filter(|last| *last > 0.0 && *last < farthest) {
        depths.push(2.0 * last);
    }
    Ok(depths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_follow_the_farthest_particle() {
        let at = |z| Particle { frame: 0, id: 0, place_mm: [0.0, 0.0, z], intensity: 1.0, uncertainty: None };
        let of = |z: f64| slabs(None, &[0.0, 1.0, 5.0], &[at(z)]).unwrap();
        assert_eq!(of(-4.9), [0.0, 1.0, 5.0]);
        assert_eq!(of(0.5), [0.0, 0.1, 0.5]);
        assert_eq!(of(0.03), [0.0, 0.01, 0.05]);
        assert_eq!(of(12.0), [0.0, 1.0, 5.0, 10.0, 20.0]);
        assert_eq!(slabs(None, &[0.0, 1.0], &[]).unwrap(), [0.0, 1.0]);
        assert_eq!(slabs(Some(&[0.0, 3.0]), &[0.0, 1.0], &[]).unwrap(), [0.0, 3.0]);
        assert!(slabs(Some(&[3.0, 2.0]), &[0.0, 1.0], &[]).is_err());
    }
}
