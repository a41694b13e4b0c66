//! Smoothing of a field on a lattice.

/// Constant: how many standard deviations the weights reach; there a Gaussian weighs a hundredth.
pub(crate) const REACH: f64 = 3.0;

/// Smooths along one axis after the other: at each node the value of the straight line through its neighbours, by least
/// squares under Gaussian weights of standard deviation `sigma` nodes. A linear field stays what it is, ends included.
pub(crate) fn smooth(shape: [usize; 3], vectors: &mut [[f64; 3]], sigma: [f64; 3]) {
    let stride = [1, shape[0], shape[0] * shape[1]];
    for axis in 0..3 {
        let rows: Vec<(usize, Vec<f64>)> =
            (0..shape[axis]).map(|node| weights(node, shape[axis], sigma[axis])).collect();
        let before = vectors.to_vec();
        for (node, vector) in vectors.iter_mut().enumerate() {
            let place = node / stride[axis] % shape[axis];
            let (first, weights) = &rows[place];
            let own = before[node];
            let mut change = [0.0; 3];
            for (k, weight) in weights.iter().enumerate() {
                let near = before[node + (first + k) * stride[axis] - place * stride[axis]];
                // Differences, so that a uniform field is kept to the last bit.
                (0..3).for_each(|a| change[a] += weight * (near[a] - own[a]));
            }
            *vector = std::array::from_fn(|a| own[a] + change[a]);
        }
    }
}

/// What the line through the neighbours of `node`, of `n` nodes, gives there: weights of the nodes from the first on.
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
        let linear: Vec<[f64; 3]> = (0..315).map(at).map(|[x, y, z]| [1.0 + 0.2 * x - y, 3.0 * z, x + y]).collect();
        let mut smoothed = linear.clone();
        smooth(shape, &mut smoothed, [1.4, 0.7, 2.0]);
        for (smoothed, linear) in smoothed.iter().zip(&linear) {
            (0..3).for_each(|a| assert!((smoothed[a] - linear[a]).abs() < 1e-12));
        }
        // A single 1 in the middle of a row becomes the Gaussian's own weights.
        let mut spike = vec![[0.0; 3]; 21];
        spike[10] = [1.0; 3];
        smooth([21, 1, 1], &mut spike, [1.0; 3]);
        let sum: f64 = (-3..=3).map(|k: i32| (-0.5 * (k * k) as f64).exp()).sum();
        (8..13).for_each(|k: i32| {
            let wanted = (-0.5 * ((k - 10) * (k - 10)) as f64).exp() / sum;
            assert!((spike[k as usize][0] - wanted).abs() < 1e-12);
        });
    }

    #[test]
    fn a_uniform_field_is_kept_to_the_last_bit_and_no_width_smooths_nothing() {
        let mut uniform = vec![[0.1, -3.7, 1e-9]; 60];
        smooth([5, 4, 3], &mut uniform, [1.4; 3]);
        assert!(uniform.iter().all(|vector| *vector == [0.1, -3.7, 1e-9]));
        let mut rough: Vec<[f64; 3]> = (0..60).map(|k| [(k * k % 7) as f64; 3]).collect();
        let before = rough.clone();
        smooth([5, 4, 3], &mut rough, [0.0; 3]);
        assert_eq!(rough, before);
    }
}
