use super::{levels::Levels, sections::Sections};
use crate::options::Region;
use lf_core::Grid;

/// Voxels of a slice as (x + nx y, score), rising.
pub(super) type Kept = Vec<(u32, f32)>;

/// A region of slice `z`, and all that scores it except the camera.
#[derive(Clone, Copy)]
pub(super) struct Slice<'a> {
    pub(super) levels: &'a Levels<'a>,
    pub(super) sections: &'a Sections,
    pub(super) grid: &'a Grid,
    pub(super) z: usize,
    pub(super) region: &'a Region,
}
