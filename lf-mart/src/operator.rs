//! Projection and back-projection over a subset of the image's rows, weights made on the way.

use crate::kernel::PADDING;
use crate::scattered::Scattered;
use crate::tables::InLine;
use lf_core::weights::{Footprint, RowSet};

/// The weights of a support's voxels, for whichever camera.
pub(crate) enum Operator<'a> {
    /// A square lattice in line with the pixels: products of two profiles.
    InLine(Box<InLine>),
    /// Any other.
    Scattered(Scattered<'a>),
}

/// An image whose rows are long enough for four-lane reads and writes at any column.
pub(crate) struct Plane {
    pub(crate) stride: usize,
    pub(crate) values: Vec<f32>,
}

impl Plane {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let stride = Self::stride(width);
        Self { stride, values: vec![0.0; stride * height] }
    }

    /// Values a row of an image `width` pixels wide.
    pub(crate) fn stride(width: usize) -> usize {
        width + PADDING
    }
}

/// Keeps the values that are held.
pub(crate) fn keep<T>(values: &mut Vec<T>, held: &[bool]) {
    let mut held = held.iter();
    values.retain(|_| *held.next().expect("one for each"));
}

impl<'a> Operator<'a> {
    /// With weights stored where that takes no more than a part of `max_bytes`.
    pub(crate) fn new(footprint: &'a Footprint, indices: &[u64], subsets: usize, max_bytes: u64) -> Self {
        if footprint.in_line() {
            Self::InLine(Box::new(InLine::new(footprint, indices, subsets)))
        } else {
            Self::Scattered(Scattered::new(footprint, indices, subsets, max_bytes))
        }
    }

    /// Forgets the voxels that are not held.
    pub(crate) fn retain(&mut self, held: &[bool]) {
        match self {
            Self::InLine(weights) => weights.retain(held),
            Self::Scattered(weights) => weights.retain(held),
        }
    }

    /// Whether weights are made anew at every use.
    pub(crate) fn is_remade(&self) -> bool {
        matches!(self, Self::Scattered(weights) if weights.is_remade())
    }

    /// Weights of all voxels: what one projection or back-projection over all rows touches.
    pub(crate) fn weights(&self) -> u64 {
        match self {
            Self::InLine(weights) => weights.weights(),
            Self::Scattered(weights) => weights.weights(),
        }
    }

    /// The sum of each voxel's weights.
    pub(crate) fn shares(&self) -> Vec<f32> {
        match self {
            Self::InLine(weights) => weights.shares(),
            Self::Scattered(weights) => weights.shares(),
        }
    }

    /// Sets the subset's rows of `plane` to the projection of the strengths: p_i = sum_j w_ij E_j.
    pub(crate) fn project(&mut self, rows: RowSet, strengths: &[f32], plane: &mut Plane) {
        match self {
            Self::InLine(weights) => weights.project(rows, strengths, plane),
            Self::Scattered(weights) => weights.project(rows, strengths, plane),
        }
    }

    /// Calls `update(j, strength, sum_i w_ij v_i, sum_i w_ij)` on every voxel's strength, i over the subset's rows.
    pub(crate) fn back_project(
        &mut self,
        rows: RowSet,
        plane: &Plane,
        strengths: &mut [f32],
        update: impl Fn(usize, &mut f32, f32, f32) + Sync,
    ) {
        match self {
            Self::InLine(weights) => weights.back_project(rows, plane, strengths, update),
            Self::Scattered(weights) => weights.back_project(rows, plane, strengths, update),
        }
    }
}
