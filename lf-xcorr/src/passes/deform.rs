//! Both volumes of a pair, moved half way towards each other along a predicted field, so that their particles coincide.
//!
//! Convention: the field is a displacement at midpoints. Light at `a` of the first volume goes to the `m` with `m = a +
//! d(m) / 2`, light at `b` of the second to the `m` with `m = b - d(m) / 2`. Midpoints that are masked, or that belong
//! to a place outside the volume, are cut from both volumes: a cut in one of them only would pull the peak.
//!
//! Departure: usually the light of every target voxel is interpolated at the place that it comes from. Here each lit
//! voxel is spread over the 6 x 6 x 6 voxels around its target with the quintic B-spline. This costs 216 additions per
//! lit voxel and none per dark one, loses no light, keeps it positive, and moves the first five moments of every
//! particle image exactly, because the spline reproduces polynomials up to the fifth degree. The remaining error shifts
//! the peak of particles of 0.75 voxel by less than 0.001 voxel; with the cubic spline it is 0.007, with straight lines
//! 0.06. The spline adds a variance of 1/2 voxel^2 to a particle image along each axis.

use super::predictor::Predictor;
use crate::volumes::{Mask, Rows, lit};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Variance that the spline adds along each axis.
pub(crate) const SPLINE_VARIANCE_VOX2: f64 = 0.5;

/// Voxels that a spline reaches along an axis, and those of them before the voxel that holds its centre.
const REACH: usize = 6;
const BEFORE: usize = 2;

/// The pair at the midpoints of `field` inside `mask`. A moved voxel below the floor of its volume is dark.
pub(crate) fn matched(pair: [&Rows; 2], field: &Predictor, mask: &Mask) -> [Rows; 2] {
    let counts = |place: [usize; 3]| counts(place, field, mask, pair[0].shape);
    [moved(pair[0], field, 0.5, &counts), moved(pair[1], field, -0.5, &counts)]
}

/// Whether the light at a midpoint counts: it is not masked, and both its places are inside the volume, with a margin
/// for light that the spline would spread from outside.
fn counts(place: [usize; 3], field: &Predictor, mask: &Mask, shape: [usize; 3]) -> bool {
    // Constant: nearly all light comes from within 1.5 voxels. The margin is 0 where nothing moves, because no light is
    // missing there, and at most a tenth of the volume, so that a thin one keeps its middle.
    const MARGIN_VOX: f64 = 1.5;
    const MARGIN_SHARE: f64 = 0.1;
    let middle = place.map(|place| place as f64);
    let shift = field.at(middle.into()).abs();
    let is_inside = |a: usize| {
        let reach = 0.5 * shift[a] + shift[a].min(MARGIN_VOX).min(MARGIN_SHARE * shape[a] as f64);
        middle[a] - reach >= -0.5 && middle[a] + reach <= shape[a] as f64 - 0.5
    };
    (0..3).all(is_inside) && mask.holds_in_part(place, shape)
}

/// The light of `rows` at the midpoints: `share` 0.5 for a first volume, -0.5 for a second.
fn moved(rows: &Rows, field: &Predictor, share: f64, counts: &(dyn Fn([usize; 3]) -> bool + Sync)) -> Rows {
    let shape = rows.shape;
    let plane = |z: usize| MovedPlane::new(rows, z, |place| midpoint(place, field, share));
    let planes: Vec<MovedPlane> = (0..shape[2]).into_par_iter().map(plane).collect();
    let lists_of = |dense: &mut Vec<f32>, z: usize| -> Vec<Vec<(u32, f32)>> {
        dense.resize(shape[0] * shape[1], 0.0);
        planes.iter().for_each(|plane| plane.spread(z, shape, dense));
        let row = |(y, row)| lit(row, rows.threshold).filter(|(x, _)| counts([*x as usize, y, z])).collect();
        let lists = dense.chunks(shape[0]).enumerate().map(row).collect();
        dense.fill(0.0);
        lists
    };
    let lists = (0..shape[2]).into_par_iter().map_init(Vec::new, lists_of).flatten_iter();
    Rows::from_lists(shape, &lists.collect::<Vec<_>>())
}

/// Estimate of a deformed volume's lit voxels, from a few slices. A move by half a voxel lights the most voxels.
pub(crate) fn spread_count(rows: &Rows) -> f64 {
    const SLICES: usize = 9;
    let [nx, ny, nz] = rows.shape;
    let few = nz.min(SLICES);
    let lit = (0..few).into_par_iter().map(|n| {
        let z = ((n as f64 + 0.5) * nz as f64 / few as f64) as usize;
        let mut dense = vec![0f32; nx * ny];
        let near = z.saturating_sub(REACH - BEFORE - 1)..(z + BEFORE + 1).min(nz);
        near.for_each(|source| MovedPlane::new(rows, source, |place| place + 0.5).spread(z, rows.shape, &mut dense));
        lit(&dense, rows.threshold).count()
    });
    lit.sum::<usize>() as f64 * nz as f64 / few as f64
}

/// The targets of one plane of lit voxels.
struct MovedPlane {
    /// Target, voxels, and intensity.
    light: Vec<(Vec3, f32)>,
    /// Planes that the light reaches.
    reach: Range<usize>,
}

impl MovedPlane {
    fn new(rows: &Rows, z: usize, target: impl Fn(DVec3) -> DVec3) -> Self {
        let [_, ny, nz] = rows.shape;
        let target = |x: u32, y: usize| target(DVec3::new(x as f64, y as f64, z as f64)).as_vec3();
        let in_row = |y: usize| rows.row(y, z).map(move |(x, value)| (x, y, value));
        let light = (0..ny).flat_map(in_row).map(|(x, y, value)| (target(x, y), value));
        let light: Vec<(Vec3, f32)> = light.collect();
        let heights = || light.iter().map(|(target, _)| target.z.floor() as i64);
        let from = heights().min().map_or(0, |low| (low - BEFORE as i64).max(0));
        let to = heights().max().map_or(0, |high| (high + (REACH - BEFORE) as i64).min(nz as i64));
        Self { light, reach: from as usize..to.max(from) as usize }
    }

    /// Adds the light that reaches plane `z` of a volume of `shape` to that plane, which is dense.
    fn spread(&self, z: usize, shape: [usize; 3], dense: &mut [f32]) {
        if !self.reach.contains(&z) {
            return;
        }
        for &(target, value) in &self.light {
            let base = target.floor();
            let first = base.to_array().map(|place| place as i64 - BEFORE as i64);
            let k = z as i64 - first[2];
            if !(0..REACH as i64).contains(&k) {
                continue;
            }
            let value = value * spline(target.z - base.z)[k as usize];
            let [along_x, along_y] = [spline(target.x - base.x), spline(target.y - base.y)];
            for (j, weight) in along_y.iter().enumerate() {
                let y = first[1] + j as i64;
                if (0..shape[1] as i64).contains(&y) {
                    let row = &mut dense[y as usize * shape[0]..][..shape[0]];
                    add_to_row(row, first[0], value * weight, &along_x);
                }
            }
        }
    }
}

/// Adds `value` times the weights to the voxels of a row from `first` on, as far as they are inside.
#[inline]
fn add_to_row(row: &mut [f32], first: i64, value: f32, weights: &[f32; REACH]) {
    if first >= 0 && first + REACH as i64 <= row.len() as i64 {
        let row = &mut row[first as usize..][..REACH];
        (0..REACH).for_each(|i| row[i] += value * weights[i]);
    } else {
        for (i, weight) in weights.iter().enumerate() {
            if let Some(to) = usize::try_from(first + i as i64).ok().and_then(|x| row.get_mut(x)) {
                *to += value * weight;
            }
        }
    }
}

/// The midpoint of light at `place`.
fn midpoint(place: DVec3, field: &Predictor, share: f64) -> DVec3 {
    // The field is a function of the unknown midpoint, so iterate. Each round divides the error by 2 / gradient.
    const ROUNDS: usize = 8;
    const CLOSE_VOX: f64 = 1e-4;
    let mut shift = field.at(place);
    for _ in 0..ROUNDS {
        let better = field.at(place + share * shift);
        let change = (better - shift).abs().max_element();
        shift = better;
        if change < CLOSE_VOX {
            break;
        }
    }
    place + share * shift
}

/// The quintic B-spline's weights of the voxels -2 to 3, centred `t` beyond voxel 0.
fn spline(t: f32) -> [f32; REACH] {
    let rest = 1.0 - t;
    let [fifth, rest_fifth] = [t, rest].map(|t| t * t * t * t * t);
    [
        rest_fifth,
        26.0 + t * (-50.0 + t * (20.0 + t * (20.0 + t * (-20.0 + 5.0 * t)))),
        66.0 + t * t * (-60.0 + t * t * (30.0 - 10.0 * t)),
        26.0 + t * (50.0 + t * (20.0 + t * (-20.0 + t * (-20.0 + 10.0 * t)))),
        1.0 + t * (5.0 + t * (10.0 + t * (10.0 + t * (5.0 - 5.0 * t)))),
        fifth,
    ]
    .map(|weight| weight / 120.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volumes::Sparse;
    use lf_core::grid::Grid;

    #[test]
    fn the_spline_reproduces_polynomials_to_the_fifth_degree() {
        for t in [0.0f32, 0.1, 0.5, 0.73, 0.999] {
            let moment = |power: i32| -> f64 {
                let places = spline(t).into_iter().zip(-2..);
                places.map(|(weight, voxel)| weight as f64 * (voxel as f64 - t as f64).powi(power)).sum()
            };
            // By hand: the moments of the sum of six uniform variables of variance 1/12.
            for (power, wanted) in [(0, 1.0), (1, 0.0), (2, 0.5), (3, 0.0), (4, 0.7), (5, 0.0)] {
                assert!((moment(power) - wanted).abs() < 1e-5, "{power} at {t}: {}", moment(power));
            }
        }
    }

    /// A field between eight nodes, `step` apart, that is not smoothed.
    fn corners(step: DVec3, nodes: Vec<Option<DVec3>>) -> Predictor {
        Predictor::new([2, 2, 2], DVec3::ZERO, step, nodes, DVec3::ZERO, 0.0).unwrap()
    }

    /// The oracle moves a lit voxel to its target by the definition, in a field that is solved by hand.
    #[test]
    fn a_shear_moves_centres_of_mass_half_way_and_keeps_their_light() {
        let shape = [40, 30, 20];
        let grid = Grid { shape, spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        // u = 0.2 (y - 10), w = 0.1 (x - 20) at the nodes, linear between them.
        let nodes = (0..8).map(|k| {
            let [x, y] = [(k % 2) as f64 * 39.0, (k / 2 % 2) as f64 * 29.0];
            Some(DVec3::new(0.2 * (y - 10.0), 0.0, 0.1 * (x - 20.0)))
        });
        let field = corners(DVec3::new(39.0, 29.0, 19.0), nodes.collect());
        for (share, place) in [(0.5, [12usize, 17, 9]), (-0.5, [25, 6, 11])] {
            let lit = Sparse { grid: &grid, indices: &[grid.index(place)], intensity: &[3.0] };
            let rows = Rows::new(&lit, &Mask::Everything, 0.0);
            let moved = moved(&rows, &field, share, &|_| true);
            let (mut light, mut centre) = (0.0, [0.0; 3]);
            for row in 0..shape[1] * shape[2] {
                for (x, value) in moved.row(row % shape[1], row / shape[1]) {
                    light += value as f64;
                    let voxel = [x as usize, row % shape[1], row / shape[1]];
                    (0..3).for_each(|a| centre[a] += value as f64 * voxel[a] as f64);
                }
            }
            let [x, y, z] = place.map(|p| p as f64);
            // At the midpoint: y stays, x' = x + share u(y), z' = z + share w(x').
            let across = x + share * 0.2 * (y - 10.0);
            let wanted = [across, y, z + share * 0.1 * (across - 20.0)];
            let before = f64::from(rows.value[0]);
            assert!((light / before - 1.0).abs() < 1e-5, "{light} {before}");
            (0..3).for_each(|a| assert!((centre[a] / light - wanted[a]).abs() < 1e-3, "{centre:?} {wanted:?}"));
        }
    }

    /// By hand: at a shift of 4 voxels, places from 11 on in the first volume and below 4 in the second have no
    /// partner. At the midpoints these are places below 2 and above 12, and a margin of 1.5 is added.
    #[test]
    fn places_without_a_partner_are_cut_from_both_alike() {
        let shape = [15, 3, 3];
        let field = corners(DVec3::new(14.0, 2.0, 2.0), vec![Some(4.0 * DVec3::X); 8]);
        let even = Rows::of_dense(shape, &[1.0; 135]);
        let support: Vec<u64> = (0..135).filter(|i| i % 15 != 5).collect();
        for (mask, wanted) in [
            (Mask::Everything, (3..12).collect::<Vec<u32>>()),
            (Mask::Support(&support), vec![3, 4, 6, 7, 8, 9, 10, 11]),
        ] {
            let [first, second] = matched([&even, &even], &field, &mask);
            assert_eq!(first.run(1, 1, 0, 15).0, wanted);
            assert_eq!(second.run(1, 1, 0, 15).0, wanted);
        }
    }
}
