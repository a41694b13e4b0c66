//! The image rows and the lenslets that a walk visits.

use super::images::MicroLayout;
use crate::weights::model::RowSet;
use std::ops::Range;

/// The rows that a walk covers.
pub(super) struct Wanted<'a> {
    pub(super) rows: RowSet,
    /// Rows of lenslets.
    pub(super) lenslets: Range<usize>,
    pub(super) layout: MicroLayout,
    /// Each micro-image's first row on the sensor, modulo the set's step.
    pub(super) remainders: &'a [i32],
}
