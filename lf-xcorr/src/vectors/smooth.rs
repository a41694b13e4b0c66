//! Smoothing of a vector field on a grid.

use glam::DVec3;

/// Constant: the weights reach this many standard deviations; there a Gaussian has fallen to a hundredth.
pub(crate) const REACH: f64 = 3.0;

/// Smooths along one axis after the other. Each node takes the value of the straight line through its neighbours, by
/// least squares under Gaussian weights of standard deviation `sigma` nodes. A linear field is unchanged, also at its
/// ends.
pub(crate) fn smooth(shape: [usize; 3], vectors: &[DVec3], sigma: DVec3) -> Vec<DVec3> {
    let mut stride = 1;
    let mut smoothed = vectors.to_vec();
    for axis in 0..3 {
        let rows: Vec<_> = (0..shape[axis]).map(|node| weights(node, shape[axis], sigma[axis])).collect();
        let before = smoothed.clone();
        for (node, vector) in smoothed.iter_mut().enumerate() {
            let place = node / stride % shape[axis];
            let (first, weights) = &rows[place];
            let near = before[node + first * stride - place * stride..].iter().step_by(stride);
            // Add differences, so that a uniform field is kept to the last bit.
            let changes = weights.iter().zip(near).map(|(weight, near)| *weight * (*near - before[node]));
            *vector = before[node] + changes.fold(DVec3::ZERO, |sum, change| sum + change);
        }
        stride *= shape[axis];
    }
    smoothed
}

/// The first neighbour, and the weights from it on, that give the line's value at `node` of `n` nodes.
fn weights(node: usize, n: usize, sigma: f64) -> (usize, Vec<f64>) {
    let reach = (REACH * sigma).ceil() as usize;
    let first = node.saturating_sub(reach);
    let nodes = first..(node + reach + 1).min(n);
    let distance = |other: usize| other as f64 - node as f64;
    let gaussian = |other: usize| (-0.5 * (distance(other) / sigma.max(1e-3)).powi(2)).exp();
    let moment = |power: i32| nodes.clone().map(|other| gaussian(other) * distance(other).powi(power)).sum::<f64>();
    let [m0, m1, m2] = [0, 1, 2].map(moment);
    let determinant = m0 * m2 - m1 * m1;
    let weight = |other: usize| {
        if determinant > 1e-9 * m0 * m0 {
            gaussian(other) * (m2 - m1 * distance(other)) / determinant
        } else {
            gaussian(other) / m0
        }
    };
    (first, nodes.clone().map(weight).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_fields_stay_and_noise_goes_as_the_filter_says() {
        let shape = [9, 7, 5];
        let at = |k: usize| [(k % 9) as f64, (k / 9 % 7) as f64, (k / 63) as f64];
        let linear = (0..315).map(at).map(|[x, y, z]| DVec3::new(1.0 + 0.2 * x - y, 3.0 * z, x + y));
        let linear: Vec<DVec3> = linear.collect();
        for (smoothed, linear) in smooth(shape, &linear, DVec3::new(1.4, 0.7, 2.0)).iter().zip(&linear) {
            assert!((*smoothed - *linear).abs().max_element() < 1e-12);
        }
        // A single 1 in the middle of a row becomes the Gaussian's own weights.
        let mut spike = vec![DVec3::ZERO; 21];
        spike[10] = DVec3::ONE;
        let smoothed = smooth([21, 1, 1], &spike, DVec3::ONE);
        let sum: f64 = (-3..=3).map(|k: i32| (-0.5 * (k * k) as f64).exp()).sum();
        (8..13).for_each(|k: i32| {
            let wanted = (-0.5 * ((k - 10) * (k - 10)) as f64).exp() / sum;
            assert!((smoothed[k as usize][0] - wanted).abs() < 1e-12);
        });
    }

    #[test]
    fn a_uniform_field_is_kept_to_the_last_bit_and_no_width_smooths_nothing() {
        let uniform = vec![DVec3::new(0.1, -3.7, 1e-9); 60];
        assert_eq!(smooth([5, 4, 3], &uniform, DVec3::splat(1.4)), uniform);
        let rough: Vec<DVec3> = (0..60).map(|k| DVec3::splat((k * k % 7) as f64)).collect();
        assert_eq!(smooth([5, 4, 3], &rough, DVec3::ZERO), rough);
    }
}
