//! The weights of an aligned camera: a column profile for each x and z, a row profile for each line (y, z) of voxels. A
//! voxel of 1000 weights costs two profiles of 30.

use super::stencils::{CutStencil, Stencil};
use super::{kernel::ColumnProfiles, plane::keep};
use lf_core::weights::{Aligned, Chords, Piece};
use rayon::prelude::*;
use std::ops::Range;

/// An image row and its share, with the scale of the aperture.
#[derive(Clone, Copy)]
pub(super) struct RowShare {
    pub(super) row: u32,
    pub(super) share: f32,
}

pub(crate) struct ProfileWeights {
    pub(super) has_round_stop: bool,
    pub(super) subsets: usize,
    pub(super) slices: usize,
    /// Support voxels of line (y, z) are `lines[y + ny z] .. lines[y + ny z + 1]`.
    pub(super) lines: Vec<u32>,
    /// Column profile of each support voxel.
    pub(super) profiles: Vec<u32>,
    pub(super) columns: ColumnProfiles,
    pub(super) row_shares: Vec<RowShare>,
    /// The cut of each row share by a round stop.
    pub(super) chords: Vec<Chords>,
    /// Sum of each line's row shares, without the scale of the aperture.
    line_sums: Vec<f32>,
    /// Row shares of a line's subset s are `row_starts[line * (subsets + 1) + s] ..` the next.
    pub(super) row_starts: Vec<u32>,
    /// Image rows of a band.
    pub(super) band: usize,
    /// Lines of slice z that light rows of a band: `reached[band * slices + z]`.
    pub(super) reached: Vec<Range<u32>>,
    /// Factor from the sum of products of shares to a voxel's whole light.
    scale: f32,
}

/// The image has at least this number of bands, so that there is work for all threads.
const LEAST_BANDS: usize = 16;
/// Values in the rows of a band's subset: 512 kB, a fraction of a core's own cache.
const CACHED_VALUES: usize = 1 << 17;
/// Slices whose profiles are counted to estimate the memory of all.
const SAMPLE_SLICES: usize = 9;

/// The row profiles of a slice's lines.
#[derive(Default)]
struct SliceRows {
    stencils: Vec<RowShare>,
    chords: Vec<Chords>,
    starts: Vec<u32>,
    sums: Vec<f32>,
}

impl SliceRows {
    /// Row profiles of the lines of slice `z` that hold voxels, sorted by subset.
    fn new(aligned: &Aligned, z: usize, subsets: usize, holds: impl Fn(usize) -> bool) -> Self {
        let (mut rows, mut pieces) = (Self::default(), Vec::new());
        for y in 0..aligned.grid().shape[1] {
            pieces.clear();
            if holds(y) {
                aligned.rows(y, z, &mut pieces);
            }
            pieces.sort_by_key(|piece| piece.pixel as usize % subsets);
            rows.sums.push(pieces.iter().map(|piece| piece.weight).sum());
            let base = rows.stencils.len();
            let before = |subset: usize| pieces.partition_point(|piece| (piece.pixel as usize % subsets) < subset);
            rows.starts.extend((0..=subsets).map(|subset| (base + before(subset)) as u32));
            let stencil = |piece: &Piece| RowShare { row: piece.pixel, share: aligned.scale() * piece.weight };
            rows.stencils.extend(pieces.iter().map(stencil));
            if aligned.has_round_stop() {
                rows.chords.extend(pieces.iter().map(|piece| aligned.chords(piece)));
            }
        }
        rows
    }
}

/// The column profiles of slice `z`, and the number of the one of each voxel; the voxels are at these x.
fn slice_columns(aligned: &Aligned, z: usize, voxels: impl Iterator<Item = usize>) -> (Vec<u32>, ColumnProfiles) {
    const UNKNOWN: u32 = u32::MAX;
    let mut columns = ColumnProfiles::new(aligned.sensor_px()[0], aligned.has_round_stop());
    let mut known = vec![UNKNOWN; aligned.grid().shape[0]];
    let mut pieces = Vec::new();
    let mut profile = |x: usize| {
        if known[x] == UNKNOWN {
            known[x] = columns.profiles.len() as u32;
            pieces.clear();
            aligned.columns(x, z, &mut pieces);
            columns.push(&pieces);
        }
        known[x]
    };
    (voxels.map(&mut profile).collect(), columns)
}

impl ProfileWeights {
    pub(crate) fn new(aligned: &Aligned, indices: &[u64], subsets: usize) -> Self {
        // Find where the voxels of each line begin.
        let [nx, ny, nz] = aligned.grid().shape;
        let has_round_stop = aligned.has_round_stop();
        let start = |line: u64| indices.partition_point(|index| *index < line * nx as u64) as u32;
        let lines: Vec<u32> = (0..=ny as u64 * nz as u64).map(start).collect();

        // Make the columns of all slices side by side, then append slice after slice.
        let of_slice = |z: usize| {
            let voxels = &indices[lines[ny * z] as usize..lines[ny * (z + 1)] as usize];
            slice_columns(aligned, z, voxels.iter().map(|index| (index % nx as u64) as usize))
        };
        let slices: Vec<(Vec<u32>, ColumnProfiles)> = (0..nz).into_par_iter().map(of_slice).collect();
        let [width, height] = aligned.sensor_px();
        let mut this = Self {
            has_round_stop,
            subsets,
            slices: nz,
            lines,
            profiles: Vec::with_capacity(indices.len()),
            columns: ColumnProfiles::new(width, has_round_stop),
            row_shares: Vec::new(),
            chords: Vec::new(),
            line_sums: Vec::new(),
            row_starts: Vec::new(),
            band: (height / LEAST_BANDS).clamp(1, CACHED_VALUES.div_ceil(width) * subsets),
            reached: Vec::new(),
            scale: aligned.scale() * if has_round_stop { std::f32::consts::FRAC_PI_4 } else { 1.0 },
        };
        // Append the columns, then make the rows of all lines and the ranges that each band needs.
        this.columns.reserve(slices.iter().map(|(_, columns)| columns));
        for (profiles, columns) in slices {
            let first = this.columns.profiles.len() as u32;
            this.profiles.extend(profiles.iter().map(|profile| first + profile));
            this.columns.append(columns);
        }
        this.fill_rows(aligned);
        this.find_reached(height.div_ceil(this.band), ny, nz);
        this
    }

    fn fill_rows(&mut self, aligned: &Aligned) {
        let [_, ny, nz] = aligned.grid().shape;
        let (lines, subsets) = (&self.lines, self.subsets);
        let of_slice = |z: usize| SliceRows::new(aligned, z, subsets, |y| lines[ny * z + y] < lines[ny * z + y + 1]);
        let slices: Vec<SliceRows> = (0..nz).into_par_iter().map(of_slice).collect();
        for slice in slices {
            let first = self.row_shares.len() as u32;
            self.row_starts.extend(slice.starts.iter().map(|start| first + start));
            self.row_shares.extend(slice.stencils);
            self.chords.extend(slice.chords);
            self.line_sums.extend(slice.sums);
        }
    }

    fn find_reached(&mut self, bands: usize, ny: usize, nz: usize) {
        let subsets = self.subsets;
        self.reached = vec![0..0; bands * nz];
        for line in 0..ny * nz {
            let stencils = self.row_starts[line * (subsets + 1)]..self.row_starts[line * (subsets + 1) + subsets];
            for stencil in &self.row_shares[stencils.start as usize..stencils.end as usize] {
                let lines = &mut self.reached[stencil.row as usize / self.band * nz + line / ny];
                if lines.start == lines.end {
                    lines.start = line as u32;
                }
                lines.end = line as u32 + 1;
            }
        }
    }

    /// Bytes of the profiles, twice, as while they are brought together, and of the lists of lines and slices: an
    /// estimate from a sample of the slices.
    pub(super) fn estimated_bytes(aligned: &Aligned, indices: &[u64], subsets: usize) -> u64 {
        let [nx, ny, nz] = aligned.grid().shape;
        let has_round_stop = aligned.has_round_stop();
        let stencil = if has_round_stop { size_of::<CutStencil>() } else { size_of::<Stencil>() };
        let row = size_of::<RowShare>() + if has_round_stop { size_of::<Chords>() } else { 0 };
        // Count the pieces of a middle column and row in some slices.
        let (mut pieces, mut columns, mut rows) = (Vec::new(), 0.0, 0.0);
        let slices: Vec<usize> = (0..nz).step_by(nz.div_ceil(SAMPLE_SLICES)).collect();
        for &z in &slices {
            pieces.clear();
            aligned.columns(nx / 2, z, &mut pieces);
            // Runs of four are three quarters full, two to a stencil.
            columns += pieces.len() as f64 / 6.0;
            pieces.clear();
            aligned.rows(ny / 2, z, &mut pieces);
            rows += pieces.len() as f64;
        }
        // Scale them to all voxels and lines.
        let (columns, rows) = (columns / slices.len() as f64, rows / slices.len() as f64);
        let profiles = (nx as f64 * nz as f64).min(indices.len() as f64);
        let lines = (ny as f64 * nz as f64).min(indices.len() as f64);
        let bytes = profiles * (columns * stencil as f64 + 12.0) + lines * rows * row as f64;
        // Every line, lit or not, has its first voxel, the starts of its subsets, and its sum.
        let all_lines = (4 + 2 * (4 * (subsets + 1) + 4)) as f64 * ny as f64 * nz as f64;
        let bands = aligned.sensor_px()[1].min(2 * LEAST_BANDS);
        let lists = (size_of::<ColumnProfiles>() + size_of::<SliceRows>() + bands * size_of::<Range<u32>>()) as f64;
        (2.0 * bytes + all_lines + lists * nz as f64) as u64
    }

    pub(super) fn retain(&mut self, held: &[bool]) {
        keep(&mut self.profiles, held);
        let (mut kept, mut n) = (0, 0);
        for end in &mut self.lines {
            kept += held[n..*end as usize].iter().filter(|held| **held).count() as u32;
            n = *end as usize;
            *end = kept;
        }
    }

    /// Weights of all voxels, including those that a round stop cuts to 0.
    pub(super) fn weights(&self) -> u64 {
        let count = |profile: &u32| u64::from(self.columns.profiles[*profile as usize].count);
        let weights = |(starts, voxels): (&[u32], &[u32])| {
            let profiles = &self.profiles[voxels[0] as usize..voxels[1] as usize];
            u64::from(starts[self.subsets] - starts[0]) * profiles.iter().map(count).sum::<u64>()
        };
        self.row_starts.chunks(self.subsets + 1).zip(self.lines.windows(2)).map(weights).sum()
    }

    /// The sum of each voxel's weights, as if a round stop cut as much at the edge of sight as anywhere.
    pub(super) fn shares(&self) -> Vec<f32> {
        let mut shares = Vec::with_capacity(self.profiles.len());
        for (line, sum) in self.line_sums.iter().enumerate() {
            let voxels = &self.profiles[self.lines[line] as usize..self.lines[line + 1] as usize];
            shares.extend(voxels.iter().map(|profile| self.scale * sum * self.columns.profiles[*profile as usize].sum));
        }
        shares
    }
}
