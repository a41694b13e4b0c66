//! Values between the vectors of a field, and the differences that give its slopes.

use super::vector_grid::VectorGrid;
use super::vectors::{Field, MEASURED, NO_DATA};
use glam::DVec3;

/// A place may lie this many spacings outside the outermost vectors, because tools round differently.
const ROUNDING: f64 = 1e-6;

/// The cell of a regular grid that holds a place.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// The lowest of the cell's corners, as an index with x fastest.
    pub corner: usize,
    /// Steps to the next corner along each axis; 0 along an axis of one node.
    pub stride: [usize; 3],
    /// How far the place is on the way to the next corner.
    pub fraction: [f64; 3],
}

impl Cell {
    /// The cell of a place in a grid of `shape` nodes. `steps` counts nodes from the first one. A place farther outside
    /// than `beyond` nodes is moved there; its fractions are then below 0 or above 1.
    #[inline]
    pub fn new(shape: [usize; 3], steps: DVec3, beyond: f64) -> Self {
        let mut cell = Self { corner: 0, stride: [0; 3], fraction: [0.0; 3] };
        let mut stride = 1;
        for axis in 0..3 {
            let last = (shape[axis] - 1) as f64;
            let place = steps[axis].clamp(-beyond, last + beyond);
            let low = place.clamp(0.0, (last - 1.0).max(0.0)).floor();
            if shape[axis] > 1 {
                (cell.fraction[axis], cell.stride[axis]) = (place - low, stride);
            }
            cell.corner += low as usize * stride;
            stride *= shape[axis];
        }
        cell
    }

    /// The corners and their trilinear weights, which add up to 1.
    #[inline]
    pub fn corners(&self) -> [(usize, f64); 8] {
        std::array::from_fn(|upper| {
            let (mut node, mut weight) = (self.corner, 1.0);
            for axis in 0..3 {
                let is_upper = upper >> axis & 1 == 1;
                node += if is_upper { self.stride[axis] } else { 0 };
                weight *= if is_upper { self.fraction[axis] } else { 1.0 - self.fraction[axis] };
            }
            (node, weight)
        })
    }
}

/// A field at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interpolated {
    /// Displacement, mm.
    pub displacement_mm: DVec3,
    /// Standard uncertainty, mm, with the weights of the displacement: neighbours share their errors. NaN if a vector
    /// with weight states none.
    pub uncertainty_mm: DVec3,
    /// Whether all vectors with weight are flagged measured.
    pub is_measured: bool,
}

/// Two vectors whose difference, over their distance, is the slope at a vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// The vector at the lower place.
    pub low: usize,
    /// The vector at the higher place.
    pub high: usize,
    /// Spacings between them: 1 or 2.
    pub steps: usize,
    /// Distance between them, mm.
    pub distance_mm: f64,
}

impl VectorGrid {
    /// The cell that holds a place; a place outside is moved to the outermost vectors.
    #[inline]
    pub fn cell(&self, place_mm: DVec3) -> Cell {
        Cell::new(self.shape, self.steps_to(place_mm), 0.0)
    }

    /// Whether a place lies between the outermost vectors.
    fn covers(&self, place_mm: DVec3) -> bool {
        let (steps, last) = (self.steps_to(place_mm), DVec3::from(self.shape.map(|count| count as f64 - 1.0)));
        (steps.cmpge(DVec3::splat(-ROUNDING)) & steps.cmple(last + ROUNDING)).all()
    }

    /// Distance of a place from the first vector, in spacings.
    fn steps_to(&self, place_mm: DVec3) -> DVec3 {
        (place_mm - DVec3::from(self.origin_mm)) / DVec3::from(self.spacing_mm)
    }

    /// The difference that gives the slope at vector `at` along an axis: between its neighbours, or at an end and
    /// beside a gap between one neighbour and itself. None if the vector or both neighbours have no data.
    pub fn difference(&self, at: usize, axis: usize, has_data: impl Fn(usize) -> bool) -> Option<Difference> {
        let [before, after] = [-1, 1].map(|step| self.neighbour(at, axis, step).filter(|near| has_data(*near)));
        let steps = [before, after].into_iter().flatten().count();
        let found = Difference {
            low: before.unwrap_or(at),
            high: after.unwrap_or(at),
            steps,
            distance_mm: steps as f64 * self.spacing_mm[axis],
        };
        (steps > 0 && has_data(at)).then_some(found)
    }

    /// Length of an interrogation window along an axis, in distances between vectors; not a whole number in general.
    pub fn window_in_spacings(&self, axis: usize) -> f64 {
        self.window[axis] as f64 * self.voxel_mm[axis] / self.spacing_mm[axis]
    }
}

impl Field {
    /// The field at a place, trilinear between the eight vectors around it. None outside the outermost vectors, or if a
    /// vector with weight has no data.
    pub fn interpolate(&self, place_mm: DVec3) -> Option<Interpolated> {
        if !self.layout.covers(place_mm) {
            return None;
        }
        let mut found = Interpolated { displacement_mm: DVec3::ZERO, uncertainty_mm: DVec3::ZERO, is_measured: true };
        for (at, weight) in self.layout.cell(place_mm).corners().into_iter().filter(|(_, weight)| *weight > 0.0) {
            if self.flag[at] == NO_DATA {
                return None;
            }
            found.is_measured &= self.flag[at] == MEASURED;
            found.displacement_mm += weight * self.displacement_mm(at);
            found.uncertainty_mm += weight * self.uncertainty_mm(at);
        }
        Some(found)
    }

    /// The place, mm, to which the field moves a place. The displacement is that half way there, interpolated between
    /// the vectors with data. Outside the field the outermost vectors count. None where no vector around has data.
    pub fn follow(&self, place_mm: DVec3) -> Option<DVec3> {
        let displacement = |place_mm: DVec3| {
            let corners = self.layout.cell(place_mm).corners().into_iter();
            let known = corners.filter(|(at, weight)| *weight > 0.0 && self.flag[*at] != NO_DATA);
            let (sum, weights) = known.fold((DVec3::ZERO, 0.0), |(sum, weights), (at, weight)| {
                (sum + weight * self.displacement_mm(at), weights + weight)
            });
            (weights > 0.0).then(|| sum / weights)
        };
        let half_way = place_mm + 0.5 * displacement(place_mm)?;
        displacement(half_way).map(|displacement_mm| place_mm + displacement_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::REPLACED;

    /// A flow that trilinear interpolation reproduces to the rounding of f32.
    fn flow([x, y, z]: [f64; 3]) -> [f64; 3] {
        [1.0 + 2.0 * x - y + 0.5 * x * y, 0.1 * x * y * z - z, 3.0 + 0.25 * y * z]
    }

    fn field(shape: [usize; 3], flow: impl Fn([f64; 3]) -> [f64; 3]) -> Field {
        let mut field = Field::empty(VectorGrid {
            shape,
            spacing_mm: [0.5, 0.25, 2.0],
            origin_mm: [-1.0, 0.5, -3.0],
            ..VectorGrid::default()
        });
        for i in 0..field.len() {
            let [u, v, w] = flow(field.place_mm(i)).map(|component| component as f32);
            (field.u[i], field.v[i], field.w[i], field.flag[i]) = (u, v, w, MEASURED);
        }
        field
    }

    fn vector_mm(field: &Field, place_mm: [f64; 3]) -> Option<[f64; 3]> {
        field.interpolate(place_mm.into()).map(|found| found.displacement_mm.to_array())
    }

    #[test]
    fn trilinear_flow_is_reproduced() {
        let field = field([4, 5, 3], flow);
        for n in 0..200 {
            let fraction = |step: f64| (f64::from(n) * step).fract();
            let place = [-1.0 + 1.5 * fraction(0.618), 0.5 + fraction(0.414), -3.0 + 4.0 * fraction(0.732)];
            let (found, wanted) = (vector_mm(&field, place).unwrap(), flow(place));
            (0..3)
                .for_each(|axis| assert!((found[axis] - wanted[axis]).abs() < 5e-7, "{place:?}: {found:?} {wanted:?}"));
        }
    }

    #[test]
    fn the_field_ends_at_the_outermost_vectors() {
        let field = field([4, 5, 3], |_| [1.0, 2.0, 3.0]);
        for place in [[-1.0, 0.5, -3.0], [0.5, 1.5, 1.0], [0.5 + 1e-9, 1.5, 1.0]] {
            assert_eq!(vector_mm(&field, place), Some([1.0, 2.0, 3.0]));
        }
        for place in [[0.51, 1.5, 1.0], [f64::NAN, 1.5, 1.0]] {
            assert_eq!(vector_mm(&field, place), None);
        }
        let cell = field.layout.cell(DVec3::new(9.0, 0.5, -99.0));
        assert_eq!((cell.corner, cell.fraction), (2, [1.0, 0.0, 0.0]));
    }

    #[test]
    fn one_layer_of_vectors_is_known_in_its_plane_only() {
        let field = field([4, 5, 1], |_| [1.0, 2.0, 3.0]);
        assert!(vector_mm(&field, [0.1, 1.0, -3.0]).is_some() && vector_mm(&field, [0.1, 1.0, -2.9]).is_none());
    }

    #[test]
    fn a_gap_spoils_only_the_places_beside_it() {
        let mut field = field([4, 5, 3], |_| [1.0, 2.0, 3.0]);
        field.flag[0] = NO_DATA;
        assert!(vector_mm(&field, [-0.9, 0.6, -2.9]).is_none() && vector_mm(&field, [-0.5, 0.6, -2.9]).is_some());
    }

    /// A shear in x along y: half way from y = 0.75 to 1.75, u is that of y = 1.25. A gap is filled from its neighbours
    /// and the outside from the rim.
    #[test]
    fn places_go_by_the_displacement_half_way() {
        let mut field = field([4, 5, 3], |[_, y, _]| [0.1 * y, 1.0, 0.0]);
        let goes = |field: &Field, place_mm: [f64; 3]| field.follow(place_mm.into()).map(|place| place.to_array());
        let wanted = [0.125, 1.75, -2.0];
        assert!(goes(&field, [0.0, 0.75, -2.0]).unwrap().iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-7));
        let beyond = goes(&field, [0.0, 9.0, -2.0]).unwrap();
        assert!((beyond[0] - 0.15).abs() < 1e-7 && beyond[1] == 10.0, "{beyond:?}");
        field.flag[..20].fill(NO_DATA);
        assert!(
            goes(&field, [0.0, 0.75, -2.9]).unwrap().iter().zip([0.125, 1.75, -2.9]).all(|(a, b)| (a - b).abs() < 1e-7)
        );
        field.flag.fill(NO_DATA);
        assert_eq!(goes(&field, [0.0, 0.75, -2.0]), None);
    }

    #[test]
    fn uncertainty_and_flag_follow_the_weights() {
        let mut field = field([4, 5, 3], |_| [0.0; 3]);
        field.su.iter_mut().enumerate().for_each(|(at, su)| *su = at as f32);
        field.sw.fill(0.5);
        field.sw[1] = f32::NAN;
        field.flag[2] = REPLACED;
        // A quarter of the way from the first vector to the second, then from the third to the fourth.
        let first = field.interpolate([-0.875, 0.5, -3.0].into()).unwrap();
        let [su, sv, sw] = first.uncertainty_mm.to_array();
        assert!((su - 0.25).abs() < 1e-12 && sv.is_nan() && sw.is_nan() && first.is_measured);
        let third = field.interpolate([0.125, 0.5, -3.0].into()).unwrap();
        assert!((third.uncertainty_mm.x - 2.25).abs() < 1e-12 && third.uncertainty_mm.z == 0.5 && !third.is_measured);
        assert!(field.interpolate([0.5, 0.5, -3.0].into()).unwrap().is_measured);
    }

    #[test]
    fn weights_add_up_and_continue_beyond_the_grid() {
        let shape = [4, 3, 1];
        for (steps, beyond) in [([0.6, 1.7, 0.0], 0.0), ([-1.5, 3.9, 8.0], 2.0)] {
            let corners = Cell::new(shape, steps.into(), beyond).corners();
            let sum =
                |value: &dyn Fn(usize) -> f64| corners.iter().map(|(at, weight)| weight * value(*at)).sum::<f64>();
            assert!((sum(&|_| 1.0) - 1.0).abs() < 1e-12);
            assert!((sum(&|at| (at % 4) as f64) - steps[0]).abs() < 1e-12, "{corners:?}");
            assert!((sum(&|at| (at / 4) as f64) - steps[1]).abs() < 1e-12, "{corners:?}");
        }
    }

    #[test]
    fn differences_are_one_sided_at_ends_and_gaps() {
        let layout = field([4, 5, 3], flow).layout;
        let has_data = |at: usize| at != 2;
        let along = |at: usize, axis: usize| {
            layout.difference(at, axis, has_data).map(|found| (found.low, found.high, found.steps, found.distance_mm))
        };
        assert_eq!(along(5, 0), Some((4, 6, 2, 1.0)));
        assert_eq!(along(1, 0), Some((0, 1, 1, 0.5)));
        assert_eq!(along(21, 2), Some((1, 41, 2, 4.0)));
        assert_eq!(along(22, 2), Some((22, 42, 1, 2.0)));
        assert_eq!((along(3, 0), along(2, 0)), (None, None));
    }

    #[test]
    fn windows_are_measured_in_spacings() {
        let mut layout = field([2, 2, 2], flow).layout;
        (layout.window, layout.voxel_mm) = ([200, 50, 10], [0.01, 0.02, 0.1]);
        assert_eq!([0, 1, 2].map(|axis| layout.window_in_spacings(axis)), [4.0, 4.0, 0.5]);
    }
}
