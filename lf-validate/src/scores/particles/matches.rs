//! Which found particle is which true one.

use lf_core::Particle;

/// Half of the box, along each axis, in which a found particle may be away from the true one, mm: `box_mm`, or
/// [`SIGMAS`] of its standard uncertainty if that is more.
fn half_mm(found: &Particle, box_mm: [f64; 3]) -> [f64; 3] {
    let std_mm = found.uncertainty.map_or([0.0; 3], |uncertainty| uncertainty.std_mm().to_array());
    [0, 1, 2].map(|axis| box_mm[axis].max(SIGMAS * std_mm[axis]))
}

/// Standard uncertainties that a box reaches.
const SIGMAS: f64 = 3.0;

/// Pairs of (true, found) positions in the lists. Each particle is in one pair at most: the nearest two make a pair
/// first, by their distance in boxes, then the next nearest of the rest.
pub(crate) fn matches(truth: &[Particle], found: &[Particle], box_mm: [f64; 3]) -> Vec<(usize, usize)> {
    let mut by_x: Vec<usize> = (0..truth.len()).collect();
    by_x.sort_by(|a, b| truth[*a].place_mm[0].total_cmp(&truth[*b].place_mm[0]));
    let mut near = Vec::new();
    for (n, particle) in found.iter().enumerate() {
        let (half, [x, ..]) = (half_mm(particle, box_mm), particle.place_mm);
        let from = by_x.partition_point(|t| truth[*t].place_mm[0] < x - half[0]);
        for &t in by_x[from..].iter().take_while(|t| truth[**t].place_mm[0] <= x + half[0]) {
            let away = |axis: usize| (truth[t].place_mm[axis] - particle.place_mm[axis]).abs();
            if (0..3).all(|axis| away(axis) <= half[axis]) {
                // A box without width along an axis holds exact places only.
                let square = |axis: usize| if half[axis] > 0.0 { (away(axis) / half[axis]).powi(2) } else { 0.0 };
                near.push(((0..3).map(square).sum::<f64>(), t, n));
            }
        }
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    let (mut true_taken, mut found_taken) = (vec![false; truth.len()], vec![false; found.len()]);
    let mut pairs = Vec::new();
    for (_, t, n) in near {
        if !true_taken[t] && !found_taken[n] {
            (true_taken[t], found_taken[n]) = (true, true);
            pairs.push((t, n));
        }
    }
    pairs.sort_unstable();
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};
    use lf_core::particles::Uncertainty;

    fn at(place_mm: [f64; 3]) -> Particle {
        Particle { frame: 0, id: 0, place_mm, intensity: 1.0, uncertainty: None }
    }

    #[test]
    fn the_nearest_pair_comes_first_and_nobody_twice() {
        let truth = [at([0.0; 3]), at([0.4, 0.0, 0.0]), at([9.0, 0.0, 0.0])];
        // Between the first two: nearer to the second, whose own neighbour is nearer still.
        let found = [at([0.3, 0.0, 0.0]), at([0.42, 0.0, 0.0]), at([5.0, 0.0, 0.0])];
        assert_eq!(matches(&truth, &found, [0.5; 3]), [(0, 0), (1, 1)]);
        assert_eq!(matches(&truth, &found, [0.05; 3]), [(1, 1)]);
        assert_eq!(matches(&truth, &truth, [0.0; 3]), [(0, 0), (1, 1), (2, 2)]);
        assert!(matches(&truth, &[], [1.0; 3]).is_empty());
    }

    #[test]
    fn an_uncertain_particle_has_a_larger_box() {
        let covariance_mm2 = DMat3::from_diagonal(DVec3::new(0.0, 0.0, 1.0));
        let blind = Particle { uncertainty: Some(Uncertainty { covariance_mm2, intensity: 0.0 }), ..at([0.0; 3]) };
        assert_eq!(matches(&[at([0.0, 0.0, 2.9])], &[blind], [0.1; 3]), [(0, 0)]);
        assert!(matches(&[at([0.0, 0.0, 3.1])], &[blind], [0.1; 3]).is_empty());
        assert!(matches(&[at([0.2, 0.0, 2.9])], &[blind], [0.1; 3]).is_empty());
    }
}
