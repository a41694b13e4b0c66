//! The voxels of a slice, and the sections of the aperture that their rays pass.

use super::levels::Levels;
use crate::options::Region;
use glam::DVec2;
use lf_core::{Camera, Grid, Refusal, camera::Aperture, weights::sections};

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

/// The sections of the aperture.
pub(crate) struct Sections {
    /// Centres along either axis, mm.
    pub(super) centres_mm: Vec<f64>,
    /// For each row of sections v: the sections u in `first..n - first` lie inside.
    pub(super) first: Vec<usize>,
}

impl Sections {
    /// n x n sections, n as asked for or the pixels under a lenslet; n outside [`lf_core::weights::SECTIONS`] is
    /// refused. A section lies inside the stop if its centre does. A round stop has no corner sections; if they counted,
    /// every voxel would be pruned.
    pub(crate) fn new(camera: &Camera, asked: Option<usize>) -> Result<Self, Refusal> {
        let n = sections(camera, asked)?;
        let half = 0.5 * camera.aperture_mm();
        let centres_mm: Vec<f64> = (0..n).map(|i| half * ((2 * i + 1) as f64 / n as f64 - 1.0)).collect();
        let first = centres_mm
            .iter()
            .map(|v| match camera.main_lens.aperture {
                Aperture::Square => 0,
                Aperture::Circle => {
                    centres_mm.iter().take_while(|u| **u < 0.0 && **u * **u + v * v > half * half).count()
                }
            })
            .collect();
        Ok(Self { centres_mm, first })
    }

    pub(crate) fn count(&self) -> u32 {
        let n = self.centres_mm.len();
        self.first.iter().map(|first| (n - 2 * first) as u32).sum()
    }

    /// Centres of the sections inside the stop, mm; those of one v together, u rising.
    pub(super) fn inside_mm(&self) -> Vec<DVec2> {
        let n = self.centres_mm.len();
        let inside = (0..n).flat_map(|v| (self.first[v]..n - self.first[v]).map(move |u| (u, v)));
        inside.map(|(u, v)| DVec2::new(self.centres_mm[u], self.centres_mm[v])).collect()
    }
}
