//! Places of finer pixels in a lenslet's image.

use super::pictures::LANES;
use super::quantities::QUANTITIES;

/// Places of finer pixels that light can reach, and what is there.
#[derive(Debug, Default)]
pub(super) struct Spots {
    pub(super) count: usize,
    /// Where in the lines of finer pixels they are.
    pub(super) at: Vec<u32>,
    /// Places in the stop, and on the array.
    pub(super) stop: [Vec<f32>; 2],
    pub(super) hit: [Vec<f32>; 2],
    /// How the hit's x moves with both places in the stop, then its y.
    pub(super) by: [Vec<f32>; 4],
    /// The mean of the cell: level, slopes along x and y, curvatures xx, xy and yy.
    pub(super) means: [Vec<f32>; 6],
    pub(super) light: [Vec<f32>; QUANTITIES],
}

impl Spots {
    pub(super) fn begin(&mut self, most: usize) {
        let room = most + LANES;
        if self.at.len() < room {
            self.at.resize(room, 0);
            self.stop.iter_mut().chain(&mut self.hit).chain(&mut self.by).for_each(|list| list.resize(room, 0.0));
            self.means.iter_mut().chain(&mut self.light).for_each(|list| list.resize(room, 0.0));
        }
        self.count = 0;
    }

    /// The spots, in whole lanes.
    pub(super) fn room(&self) -> usize {
        self.count.next_multiple_of(LANES)
    }
}
