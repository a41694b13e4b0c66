//! Lattice coordinates: the centre of lenslet (i, j) is at (i, j), along two sides of the lattice.

use crate::{Camera, lattice::Lattice};
use glam::DVec2;

/// Corners of a square about the origin with sides of 2.
pub(super) const CORNERS: [DVec2; 4] = [DVec2::ONE, DVec2::NEG_ONE, DVec2::new(1.0, -1.0), DVec2::new(-1.0, 1.0)];

/// The lattice in its own coordinates.
pub struct Cells {
    lattice: Lattice,
    /// Perfect centre of lenslet (0, 0), mm.
    origin_mm: DVec2,
    /// From lenslet to lenslet along i and along j, mm.
    pub(super) sides_mm: [DVec2; 2],
    per_area: f64,
    pub(super) shape: CellShape,
}

/// Shape of the cell about a lenslet's centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CellShape {
    Square,
    /// The sides i and j of the lattice are 60 degrees apart.
    Hexagon,
}

impl CellShape {
    /// Largest distance of a cell's points from its centre along i or j.
    pub(super) fn half(self) -> f64 {
        match self {
            Self::Square => 0.5,
            Self::Hexagon => 2.0 / 3.0,
        }
    }
}

/// Rounds a number below 2^21 to the nearest whole number.
#[inline(always)]
pub(super) fn round(number: f32) -> i32 {
    /// Near this number, f32 has no bits behind the point.
    const WHOLE: f32 = 12_582_912.0;
    (number + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32
}

/// The centre nearest to a place on a square lattice.
#[inline(always)]
pub(super) fn nearest_square(i: f32, j: f32) -> (i32, i32) {
    (round(i), round(j))
}

/// The centre nearest to a place on a hexagonal lattice.
#[inline(always)]
pub(super) fn nearest_hexagon(i: f32, j: f32) -> (i32, i32) {
    // In coordinates i, j and k = -i - j a hexagon is a cube seen from a corner. Rounded, the three must still add up
    // to 0, so the one with the largest rounding error follows from the other two.
    let k = -i - j;
    let (a, b, c) = (round(i), round(j), round(k));
    let (x, y, z) = ((a as f32 - i).abs(), (b as f32 - j).abs(), (c as f32 - k).abs());
    let is_i = (x > y) & (x > z);
    let is_j = !is_i & (y > z);
    (if is_i { -b - c } else { a }, if is_j { -a - c } else { b })
}

impl Cells {
    pub(super) fn new(camera: &Camera) -> Self {
        let perfect = Camera { centres: None, ..camera.clone() }.lattice();
        let origin_mm = perfect.centre_mm(0, 0);
        let sides_mm = [perfect.centre_mm(1, 0) - origin_mm, perfect.centre_mm(0, 1) - origin_mm];
        let shape = if perfect.cell_mm().len() == 4 { CellShape::Square } else { CellShape::Hexagon };
        Self {
            lattice: camera.lattice(),
            origin_mm,
            sides_mm,
            per_area: 1.0 / sides_mm[0].perp_dot(sides_mm[1]),
            shape,
        }
    }

    /// Lattice coordinates of a point of the array, mm.
    #[inline(always)]
    pub(super) fn place(&self, array_mm: DVec2) -> DVec2 {
        self.step(self.lattice.perfect(array_mm) - self.origin_mm)
    }

    /// Lattice coordinates of a step on the perfect lattice, mm.
    #[inline(always)]
    fn step(&self, step_mm: DVec2) -> DVec2 {
        self.per_area * DVec2::new(step_mm.perp_dot(self.sides_mm[1]), self.sides_mm[0].perp_dot(step_mm))
    }

    /// A step on the perfect lattice, mm, from lattice coordinates.
    #[inline(always)]
    pub fn step_mm(&self, step: DVec2) -> DVec2 {
        step.x * self.sides_mm[0] + step.y * self.sides_mm[1]
    }

    /// Centre of a lenslet, mm.
    #[inline(always)]
    pub(super) fn centre_mm(&self, i: i32, j: i32) -> DVec2 {
        self.lattice.departed(self.origin_mm + self.step_mm(DVec2::new(f64::from(i), f64::from(j))))
    }

    /// The smallest and the largest lattice coordinates of the array within `sides_mm` of the axis.
    pub(super) fn bounds(&self, sides_mm: DVec2) -> [DVec2; 2] {
        let places = CORNERS.map(|corner| self.step(corner * sides_mm - self.origin_mm));
        let least = places.iter().fold(DVec2::INFINITY, |least, place| least.min(*place));
        [least, places.iter().fold(DVec2::NEG_INFINITY, |most, place| most.max(*place))]
    }
}
