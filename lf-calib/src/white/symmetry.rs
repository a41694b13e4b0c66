//! The centre of the lenslet image in its cell, by symmetry. Neither the size of a disc nor overlap can move it.

use super::{basis::shortest, mean_cell::MeanCell};
use glam::{DMat2, DVec2};

/// Samples along each side of the cell.
const GRID: usize = 64;
/// Highest harmonic of the lattice in each direction.
const HARMONICS: i64 = 6;
/// Blur before brightness is compared, as a share of the shorter side. It keeps the fundamental and removes the rim.
const BLUR: f64 = 0.18;

/// The centre of the lenslet image in its cell. Turned about it by a sixth of a turn (hexagonal lattice) or a quarter
/// (square lattice), the cell is most similar to itself. A square cell has two such points, half a diagonal apart; the
/// brighter one is taken. Brightness alone would fail: discs that overlap are brightest where they overlap.
pub(crate) fn centre_of(cell: &MeanCell, basis_px: DMat2, is_hexagonal: bool) -> DVec2 {
    let places = || (0..GRID * GRID).map(|n| DVec2::new((n % GRID) as f64, (n / GRID) as f64) / GRID as f64);
    let values: Vec<f64> = places().map(|place| cell.at(place).0).collect();
    let orders: Vec<(i64, i64)> =
        (-HARMONICS..=HARMONICS).flat_map(|n| (-HARMONICS..=HARMONICS).map(move |m| (m, n))).collect();
    let wave = |order: (i64, i64), place: DVec2| {
        DVec2::from_angle(std::f64::consts::TAU * DVec2::new(order.0 as f64, order.1 as f64).dot(place))
    };
    let harmonics: Vec<DVec2> = orders
        .iter()
        .map(|&order| places().zip(&values).map(|(place, value)| *value * wave(order, -place)).sum::<DVec2>())
        .collect();

    // The turn maps the lattice vectors (u, v) to (v, v - u) or (v, -u), and the harmonics in the same way.
    let turned = |(m, n): (i64, i64)| if is_hexagonal { (n, n - m) } else { (n, -m) };
    let pairs: Vec<(usize, usize)> = (0..orders.len())
        .filter(|&n| orders[n] != (0, 0))
        .filter_map(|n| Some((n, orders.iter().position(|&order| order == turned(orders[n]))?)))
        .collect();
    let asymmetry = |place: DVec2| -> f64 {
        let about: Vec<DVec2> =
            orders.iter().zip(&harmonics).map(|(&order, &amplitude)| wave(order, place).rotate(amplitude)).collect();
        pairs.iter().map(|&(a, b)| about[a].distance_squared(about[b])).sum()
    };
    let centre = places()
        .map(|place| (asymmetry(place), place))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(DVec2::ZERO, |(_, place)| place);
    if is_hexagonal {
        return centre;
    }
    let reciprocal = basis_px.inverse().transpose();
    let blur_px = BLUR * shortest(basis_px);
    let brightness = |place: DVec2| -> f64 {
        let blurred = orders.iter().zip(&harmonics).map(|(&order, &amplitude)| {
            let frequency = reciprocal * DVec2::new(order.0 as f64, order.1 as f64);
            let damping = (-2.0 * (std::f64::consts::PI * blur_px * frequency.length()).powi(2)).exp();
            damping * wave(order, place).rotate(amplitude).x
        });
        blurred.sum()
    };
    let corner = centre + DVec2::splat(0.5);
    if brightness(corner) > brightness(centre) { corner } else { centre }
}
