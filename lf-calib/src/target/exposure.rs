//! Images of a dot target, and the dots on it.

use glam::{DVec2, DVec3};
use lf_core::Camera;
use ndarray::Array2;
use std::collections::{BTreeMap, BTreeSet};

/// Largest number of dots from the axis along x and along y that [`grid`] gives.
const MOST_FROM_AXIS: f64 = 200.0;

/// A dot of a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dot {
    /// Identifies the dot at every depth.
    pub id: u64,
    /// Its stated position, mm.
    pub place_mm: [f64; 3],
}

/// An image of a target at one depth.
#[derive(Debug, Clone)]
pub struct Exposure {
    /// Counts, shape (height, width).
    pub pixels: Array2<f32>,
    /// All dots of the target that the image could show.
    pub dots: Vec<Dot>,
}

impl Exposure {
    /// Depth of the target: the mean over its dots.
    pub fn depth_mm(&self) -> f64 {
        self.dots.iter().map(|dot| dot.place_mm[2]).sum::<f64>() / self.dots.len().max(1) as f64
    }

    /// Stated positions of the dots across the axis, mm.
    pub(crate) fn flat_mm(&self) -> Vec<DVec2> {
        self.dots.iter().map(|dot| DVec3::from(dot.place_mm).truncate()).collect()
    }
}

/// Numbers all dots of the exposures from 0, by their ids.
pub(crate) fn numbers_by_id(exposures: &[Exposure]) -> BTreeMap<u64, usize> {
    let ids: BTreeSet<u64> = exposures.iter().flat_map(|exposure| exposure.dots.iter().map(|dot| dot.id)).collect();
    ids.into_iter().zip(0..).collect()
}

/// A square grid of dots at one depth, parallel to the sensor and with one dot on the axis. It covers a little more
/// than the sensor can see there. The ids are the same at every depth.
pub fn grid(spacing_mm: f64, depth_mm: f64, camera: &Camera) -> Vec<Dot> {
    let [half_x, half_y] =
        camera.half_view_mm().map(|half| (1.1 * half / spacing_mm).ceil().min(MOST_FROM_AXIS) as i64);
    let (columns, rows) = (-half_x..=half_x, -half_y..=half_y);
    let dot = |(n, (row, column)): (usize, (i64, i64))| Dot {
        id: n as u64,
        place_mm: [column as f64 * spacing_mm, row as f64 * spacing_mm, depth_mm],
    };
    rows.flat_map(|row| columns.clone().map(move |column| (row, column))).enumerate().map(dot).collect()
}
