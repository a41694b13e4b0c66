//! The weights of one voxel, four pixels of a row together.

use super::plane::Plane;
use lf_core::Weights;
use lf_core::weights::{RowSet, Scratch};

/// Pixels of a row that stand together.
pub(super) const LANES: usize = 4;

/// Pixels of a row side by side, and a voxel's weights on them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Four {
    /// The first pixel in a [`Plane`].
    pub(super) place: u32,
    pub(super) shares: [f32; LANES],
}

/// Buffers of a thread.
pub(super) struct RowBuffer {
    scratch: Scratch,
    listed: Vec<Four>,
    /// The weight on each place; 0 between voxels. Empty if a path finds no pixel often.
    sums: Vec<f32>,
    places: Vec<u32>,
}

impl RowBuffer {
    pub(super) fn new(weights: &Weights) -> Self {
        let [width, height] = weights.sensor_px();
        // A lenslet's image of a voxel has each pixel once. Other paths add pixels up piece by piece.
        let sums = if weights.finds_runs() { Vec::new() } else { Plane::new(width, height).values };
        Self { scratch: Scratch::default(), listed: Vec::new(), sums, places: Vec::new() }
    }

    /// The weights of a voxel. A pixel may come twice.
    #[inline(always)]
    pub(super) fn list(&mut self, weights: &Weights, index: u64) -> &[Four] {
        self.listed.clear();
        let voxel = weights.grid().voxel(index);
        let stride = Plane::stride(weights.sensor_px()[0]) as u32;
        let Self { scratch, listed, sums, places } = self;
        if sums.is_empty() {
            weights.runs(voxel, scratch, RowSet::ALL, |row, first, share, columns| {
                fours(row * stride + first, share, columns, listed);
            });
            return listed;
        }
        // Sum the weights by pixel, and note each pixel once.
        weights.runs(voxel, scratch, RowSet::ALL, |row, first, share, columns| {
            let place = row * stride + first;
            for (place, weight) in (place..).zip(columns).filter(|(_, weight)| **weight > 0.0) {
                let sum = &mut sums[place as usize];
                if *sum == 0.0 {
                    places.push(place);
                }
                *sum += share * weight;
            }
        });
        // List the pixels in fours by rising place, and clear their sums.
        places.sort_unstable();
        for place in places.drain(..) {
            // A four ends within the padding of its row, where nothing is.
            let sums = &mut sums[place as usize..][..LANES];
            if sums[0] != 0.0 {
                listed.push(Four { place, shares: std::array::from_fn(|n| sums[n]) });
                sums.fill(0.0);
            }
        }
        listed
    }
}

/// Adds the fours of a row of weights, without the zeros before the first.
#[inline(always)]
fn fours(place: u32, share: f32, columns: &[f32], listed: &mut Vec<Four>) {
    let mut from = 0;
    while let Some(zeros) = columns[from..].iter().position(|weight| *weight > 0.0) {
        from += zeros;
        let four = &columns[from..columns.len().min(from + LANES)];
        let mut shares = [0.0; LANES];
        shares.iter_mut().zip(four).for_each(|(out, weight)| *out = share * weight);
        listed.push(Four { place: place + from as u32, shares });
        from += four.len();
    }
}
