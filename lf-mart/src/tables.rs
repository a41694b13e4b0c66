//! The tables of a camera in line: a column profile a(x, z) for the voxels of a slice that share x, and a row profile
//! b(y, z) for each line of voxels. A voxel of 1000 weights costs two profiles of 30.

use crate::kernel::Profiles;
use lf_core::weights::{Chords, Footprint};
use rayon::prelude::*;
use std::ops::Range;

/// An image row and its share, scale of the aperture included.
#[derive(Clone, Copy)]
pub(crate) struct RowTap {
    pub(crate) row: u32,
    pub(crate) share: f32,
}

pub(crate) struct InLine {
    pub(crate) circle: bool,
    pub(crate) subsets: usize,
    pub(crate) slices: usize,
    /// Support voxels of line (y, z) are `lines[y + ny z] .. lines[y + ny z + 1]`.
    pub(crate) lines: Vec<u32>,
    /// Column profile of each support voxel.
    pub(crate) profiles: Vec<u32>,
    pub(crate) table: Profiles,
    pub(crate) row_taps: Vec<RowTap>,
    /// The cut of each row tap by a round stop.
    pub(crate) chords: Vec<Chords>,
    /// Sum of each line's row shares, scale of the aperture left out.
    line_sums: Vec<f32>,
    /// Row taps of a line's subset s are `row_starts[line * (subsets + 1) + s] ..` the next.
    pub(crate) row_starts: Vec<u32>,
    /// Image rows of a band.
    pub(crate) band: usize,
    /// Lines of slice z that light rows of a band, `reached[band * slices + z]`.
    pub(crate) reached: Vec<Range<u32>>,
    /// What the sum of products of shares is multiplied by for a voxel's whole light.
    scale: f32,
}

/// A band has at most this share of the image, so that there is work for all threads.
const LEAST_BANDS: usize = 16;
/// Values of the rows of a band's subset: 512 kB, a fraction of a core's own cache.
const CACHED_VALUES: usize = 1 << 17;

/// The row profiles of a slice's lines.
#[derive(Default)]
struct RowTables {
    taps: Vec<RowTap>,
    chords: Vec<Chords>,
    starts: Vec<u32>,
    sums: Vec<f32>,
}

/// The column profiles of a slice's voxels, counted from its first.
struct Columns {
    profiles: Vec<u32>,
    table: Profiles,
}

impl Columns {
    fn new(footprint: &Footprint, z: usize, voxels: impl Iterator<Item = usize>) -> Self {
        const UNKNOWN: u32 = u32::MAX;
        let mut this = Self { profiles: Vec::new(), table: Profiles::new(footprint.sensor().0, footprint.circle()) };
        let mut known = vec![UNKNOWN; footprint.grid().shape[0]];
        let mut pieces = Vec::new();
        for x in voxels {
            if known[x] == UNKNOWN {
                known[x] = this.table.len() as u32;
                pieces.clear();
                footprint.columns(x, z, &mut pieces);
                this.table.push(&pieces);
            }
            this.profiles.push(known[x]);
        }
        this
    }
}

impl InLine {
    pub(crate) fn new(footprint: &Footprint, indices: &[u64], subsets: usize) -> Self {
        let grid = footprint.grid();
        let [nx, ny, nz] = grid.shape;
        let circle = footprint.circle();
        let lines: Vec<u32> = (0..=ny as u64 * nz as u64)
            .map(|line| indices.partition_point(|index| *index < line * nx as u64) as u32)
            .collect();

        // Slice by slice side by side, then one after the other.
        let slices: Vec<Columns> = (0..nz)
            .into_par_iter()
            .map(|z| {
                let voxels = &indices[lines[ny * z] as usize..lines[ny * (z + 1)] as usize];
                Columns::new(footprint, z, voxels.iter().map(|index| (index % nx as u64) as usize))
            })
            .collect();
        let (width, height) = footprint.sensor();
        let mut this = Self {
            circle,
            subsets,
            slices: nz,
            lines,
            profiles: Vec::with_capacity(indices.len()),
            table: Profiles::new(width, circle),
            row_taps: Vec::new(),
            chords: Vec::new(),
            line_sums: Vec::new(),
            row_starts: Vec::new(),
            band: (height / LEAST_BANDS).clamp(1, CACHED_VALUES.div_ceil(width) * subsets),
            reached: Vec::new(),
            scale: footprint.scale() * if circle { std::f32::consts::FRAC_PI_4 } else { 1.0 },
        };
        this.table.reserve(slices.iter().map(|slice| &slice.table));
        for slice in slices {
            let first = this.table.len() as u32;
            this.profiles.extend(slice.profiles.iter().map(|profile| first + profile));
            this.table.append(slice.table);
        }
        this.fill_rows(footprint, ny, nz);
        this
    }

    fn fill_rows(&mut self, footprint: &Footprint, ny: usize, nz: usize) {
        let (subsets, circle) = (self.subsets, self.circle);
        let lines = &self.lines;
        let slices: Vec<RowTables> = (0..nz)
            .into_par_iter()
            .map(|z| {
                let (mut tables, mut pieces) = (RowTables::default(), Vec::new());
                for y in 0..ny {
                    pieces.clear();
                    if lines[ny * z + y] < lines[ny * z + y + 1] {
                        footprint.rows(y, z, &mut pieces);
                    }
                    pieces.sort_by_key(|piece| piece.pixel as usize % subsets);
                    tables.sums.push(pieces.iter().map(|piece| piece.weight).sum());
                    let mut subset = 0;
                    for piece in &pieces {
                        while subset <= piece.pixel as usize % subsets {
                            tables.starts.push(tables.taps.len() as u32);
                            subset += 1;
                        }
                        let share = footprint.scale() * piece.weight;
                        tables.taps.push(RowTap { row: piece.pixel, share });
                        if circle {
                            tables.chords.push(footprint.chords(piece));
                        }
                    }
                    while subset <= subsets {
                        tables.starts.push(tables.taps.len() as u32);
                        subset += 1;
                    }
                }
                tables
            })
            .collect();
        for slice in slices {
            let first = self.row_taps.len() as u32;
            self.row_starts.extend(slice.starts.iter().map(|start| first + start));
            self.row_taps.extend(slice.taps);
            self.chords.extend(slice.chords);
            self.line_sums.extend(slice.sums);
        }
        let bands = footprint.sensor().1.div_ceil(self.band);
        self.reached = vec![0..0; bands * nz];
        for line in 0..ny * nz {
            let taps = self.row_starts[line * (subsets + 1)]..self.row_starts[line * (subsets + 1) + subsets];
            for tap in &self.row_taps[taps.start as usize..taps.end as usize] {
                let lines = &mut self.reached[tap.row as usize / self.band * nz + line / ny];
                if lines.start == lines.end {
                    lines.start = line as u32;
                }
                lines.end = line as u32 + 1;
            }
        }
    }

    /// Forgets the voxels that are not held; what is known of the others stays.
    pub(crate) fn retain(&mut self, held: &[bool]) {
        crate::operator::keep(&mut self.profiles, held);
        let (mut kept, mut n) = (0, 0);
        for end in &mut self.lines {
            kept += held[n..*end as usize].iter().filter(|held| **held).count() as u32;
            n = *end as usize;
            *end = kept;
        }
    }

    /// Weights of all voxels; those that a round stop cuts to nothing among them.
    pub(crate) fn weights(&self) -> u64 {
        let lines = self.row_starts.chunks(self.subsets + 1).zip(self.lines.windows(2));
        lines
            .map(|(starts, voxels)| {
                let profiles = &self.profiles[voxels[0] as usize..voxels[1] as usize];
                let columns: u64 = profiles.iter().map(|profile| u64::from(self.table.counts[*profile as usize])).sum();
                u64::from(starts[self.subsets] - starts[0]) * columns
            })
            .sum()
    }

    /// What a round stop cuts from a voxel at the edge of sight is taken to be what it cuts from others.
    pub(crate) fn shares(&self) -> Vec<f32> {
        let mut shares = Vec::with_capacity(self.profiles.len());
        for (line, sum) in self.line_sums.iter().enumerate() {
            let voxels = &self.profiles[self.lines[line] as usize..self.lines[line + 1] as usize];
            shares.extend(voxels.iter().map(|profile| self.scale * sum * self.table.sums[*profile as usize]));
        }
        shares
    }
}
