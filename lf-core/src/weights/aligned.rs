//! Weights of a square lattice that is aligned with the pixels: products of column and row shares.
//!
//! The column shares of a voxel depend on its x and z only, the row shares on its y and z only. So two short profiles
//! give the thousand weights of a voxel. This is the fastest path.

use super::axis::{Piece, Span};
use super::{chords::Chords, geometry::Geometry, lenslets::Lenslets};
use crate::Grid;

/// Column and row profiles of an aligned camera.
#[derive(Debug, Clone)]
pub struct Aligned {
    pub(super) geometry: Geometry,
    /// To look weights up one by one, if they are exact.
    pub(super) lenslets: Option<Box<Lenslets>>,
}

impl Aligned {
    /// The grid.
    pub fn grid(&self) -> &Grid {
        &self.geometry.grid
    }

    /// Columns and rows of the sensor.
    pub fn sensor_px(&self) -> [usize; 2] {
        self.geometry.optics.sensor_px
    }

    /// Whether the stop is round. Then [`Chords`] cut the products of shares.
    pub fn has_round_stop(&self) -> bool {
        self.geometry.has_round_stop
    }

    /// Factor of every product of a column share and a row share: the full square of the aperture over the stop's area.
    pub fn scale(&self) -> f32 {
        self.geometry.scale
    }

    /// Appends the column shares of voxels (x, ., z): lenslets by rising centre, columns rising within a lenslet.
    pub fn columns(&self, x: usize, z: usize, out: &mut Vec<Piece>) {
        self.profile(0, x, z, out);
    }

    /// Appends the row shares of voxels (., y, z), in the same order.
    pub fn rows(&self, y: usize, z: usize, out: &mut Vec<Piece>) {
        self.profile(1, y, z, out);
    }

    /// The cut of a row piece by the stop.
    pub fn chords(&self, row: &Piece) -> Chords {
        self.geometry.chords(row)
    }

    fn profile(&self, along: usize, place: usize, z: usize, out: &mut Vec<Piece>) {
        let geometry = &self.geometry;
        let axis = geometry.axis(z, along);
        let [low, high] = geometry.slabs[0].x;
        let span = Span { low, high, blur: geometry.blurs(&axis)[along] };
        let voxel = if along == 0 { [place, 0, z] } else { [0, place, z] };
        let x0 = geometry.chief_mm(&axis, voxel)[along];
        let reach = axis.alpha.abs() * axis.half_aperture + high + span.blur.reach();
        let pitch = high - low;
        let zero = geometry.optics.lattice().centre_mm(0, 0)[along];
        let first = ((x0 - reach - zero) / pitch).ceil() as i64;
        let last = ((x0 + reach - zero) / pitch).floor() as i64;
        for i in first..=last {
            axis.pieces(geometry.model, x0, zero + i as f64 * pitch, &span, out);
        }
    }
}
