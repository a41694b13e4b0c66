//! A field in memory.

use super::vector_grid::VectorGrid;
use crate::Refusal;
use glam::DVec3;

/// `flag` of a measured vector.
pub const MEASURED: f32 = 0.0;
/// `flag` of a vector that was replaced from its neighbours.
pub const REPLACED: f32 = 1.0;
/// `flag` of a place without data.
pub const NO_DATA: f32 = 2.0;

/// A field of vectors, each component in the order x fastest, then y, then z.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Where the vectors are.
    pub layout: VectorGrid,
    /// Displacement along x, mm.
    pub u: Vec<f32>,
    /// Displacement along y, mm.
    pub v: Vec<f32>,
    /// Displacement along z, mm.
    pub w: Vec<f32>,
    /// Normalised correlation at the peak, 0 to 1.
    pub peak: Vec<f32>,
    /// First to second correlation peak.
    pub ratio: Vec<f32>,
    /// Standard uncertainty of u, mm; NaN if not estimated.
    pub su: Vec<f32>,
    /// Standard uncertainty of v, mm; NaN if not estimated.
    pub sv: Vec<f32>,
    /// Standard uncertainty of w, mm; NaN if not estimated.
    pub sw: Vec<f32>,
    /// [`MEASURED`], [`REPLACED`] or [`NO_DATA`].
    pub flag: Vec<f32>,
    /// Particle images in the vector's window; NaN if not counted.
    pub count: Vec<f32>,
}

impl Field {
    /// A field of `layout.shape` vectors without data: zeros, NaN for uncertainties and counts, and [`NO_DATA`].
    pub fn empty(layout: VectorGrid) -> Self {
        let len = layout.shape.iter().product();
        let all = |value: f32| vec![value; len];
        let [u, v, w, peak, ratio] = [0.0; 5].map(all);
        let [su, sv, sw, count] = [f32::NAN; 4].map(all);
        Self { layout, u, v, w, peak, ratio, su, sv, sw, flag: all(NO_DATA), count }
    }

    /// Number of vectors.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.flag.len()
    }

    /// Indices along x, y, z of vector `i`.
    fn step(&self, i: usize) -> [usize; 3] {
        let [nx, ny, _] = self.layout.shape;
        [i % nx, i / nx % ny, i / nx / ny]
    }

    /// Place of vector `i`, mm.
    pub fn place_mm(&self, i: usize) -> [f64; 3] {
        let step = self.step(i);
        [0, 1, 2].map(|axis| self.layout.origin_mm[axis] + step[axis] as f64 * self.layout.spacing_mm[axis])
    }

    /// Displacement of vector `i`, mm.
    pub fn displacement_mm(&self, i: usize) -> DVec3 {
        DVec3::new(self.u[i].into(), self.v[i].into(), self.w[i].into())
    }

    /// Standard uncertainty of vector `i`, mm.
    pub fn uncertainty_mm(&self, i: usize) -> DVec3 {
        DVec3::new(self.su[i].into(), self.sv[i].into(), self.sw[i].into())
    }

    /// Velocity of vector `i`, mm/s; None if the time between the volumes is unknown.
    pub(super) fn velocity_mm_s(&self, i: usize) -> Option<[f32; 3]> {
        let dt_s = self.layout.dt_s?;
        Some([self.u[i], self.v[i], self.w[i]].map(|mm| (f64::from(mm) / dt_s) as f32))
    }

    /// The components in the order of [`super::vector_grid::CHANNELS`].
    pub(super) fn components(&self) -> [&[f32]; 10] {
        let Self { layout: _, u, v, w, peak, ratio, su, sv, sw, flag, count } = self;
        [u, v, w, peak, ratio, su, sv, sw, flag, count].map(Vec::as_slice)
    }

    pub(super) fn check(&self) -> Result<(), Refusal> {
        for (i, &flag) in self.flag.iter().enumerate() {
            let place = || self.step(i);
            let is_known = [MEASURED, REPLACED, NO_DATA].contains(&flag);
            Refusal::unless(is_known, || format!("flag {flag} at vector {:?}", place()), "wanted 0, 1 or 2")?;
            let vector = [self.u[i], self.v[i], self.w[i]];
            let is_usable = flag == NO_DATA || vector.iter().all(|component| component.is_finite());
            let found = || format!("displacement {vector:?} at vector {:?}", place());
            Refusal::unless(is_usable, found, "wanted finite values or flag 2")?;
        }
        Ok(())
    }
}
