//! Weights as products of a column profile a(x, z) and a row profile b(y, z): the tables, and the two kernels over them.
//!
//! A voxel of 1000 weights costs two profiles of 30. Columns stand in runs of four so that the inner loop has no
//! branch but at the rim of a round stop.

use crate::operator::{Plane, Rows};
use lf_core::footprint::{Chords, Footprint, Piece};
use rayon::prelude::*;

/// Four columns in a row and their shares.
#[derive(Clone, Copy)]
struct Tap {
    column: u32,
    shares: [f32; 4],
}

/// The parts of the aperture behind a tap's columns, for a round stop; `low` and `high` hold them all.
#[derive(Clone, Copy)]
struct Parts {
    low: f32,
    high: f32,
    u0: [f32; 4],
    u1: [f32; 4],
}

/// An image row, its share (scale of the aperture included), and its cut by the stop.
#[derive(Clone, Copy)]
struct RowTap {
    row: u32,
    share: f32,
    chords: Chords,
}

/// A row tap seen from the image row.
#[derive(Clone, Copy)]
struct Source {
    line: u32,
    tap: u32,
}

pub(crate) struct InLine {
    circle: bool,
    /// Support voxels of line (y, z) are `lines[y + ny z] .. lines[y + ny z + 1]`.
    lines: Vec<u32>,
    /// Column profile of each support voxel.
    profiles: Vec<u32>,
    /// First and end tap of each profile.
    ranges: Vec<(u32, u32)>,
    /// Sum of each profile's shares.
    sums: Vec<f32>,
    taps: Vec<Tap>,
    parts: Vec<Parts>,
    row_taps: Vec<RowTap>,
    /// Sum of each line's row shares, scale of the aperture left out.
    line_sums: Vec<f32>,
    /// Row taps of a line's subset s are `row_starts[line * (subsets + 1) + s] ..` the next.
    row_starts: Vec<u32>,
    /// Sources of image row r are `source_starts[r] .. source_starts[r + 1]`.
    sources: Vec<Source>,
    source_starts: Vec<u32>,
    subsets: usize,
    /// What the sum of products of shares is multiplied by for a voxel's whole light.
    scale: f32,
}

/// The column profiles of a slice's voxels, counted from its first.
#[derive(Default)]
struct Columns {
    profiles: Vec<u32>,
    ranges: Vec<(u32, u32)>,
    sums: Vec<f32>,
    taps: Vec<Tap>,
    parts: Vec<Parts>,
}

impl Columns {
    fn new(footprint: &Footprint, z: usize, voxels: impl Iterator<Item = usize>, circle: bool) -> Self {
        const UNKNOWN: u32 = u32::MAX;
        let mut this = Self::default();
        let mut known = vec![UNKNOWN; footprint.grid().shape[0]];
        let mut pieces = Vec::new();
        for x in voxels {
            if known[x] == UNKNOWN {
                known[x] = this.ranges.len() as u32;
                pieces.clear();
                footprint.columns(x, z, &mut pieces);
                let first = this.taps.len() as u32;
                taps_of(&pieces, circle, &mut this.taps, &mut this.parts);
                this.ranges.push((first, this.taps.len() as u32));
                this.sums.push(pieces.iter().map(|piece| piece.weight).sum());
            }
            this.profiles.push(known[x]);
        }
        this
    }
}

fn taps_of(pieces: &[Piece], circle: bool, taps: &mut Vec<Tap>, parts: &mut Vec<Parts>) {
    let mut n = 0;
    while n < pieces.len() {
        let column = pieces[n].pixel;
        let mut tap = Tap { column, shares: [0.0; 4] };
        let mut part = Parts { low: f32::INFINITY, high: f32::NEG_INFINITY, u0: [0.0; 4], u1: [0.0; 4] };
        let mut filled = [false; 4];
        while n < pieces.len() {
            let piece = &pieces[n];
            let lane = piece.pixel.wrapping_sub(column) as usize;
            // Dense-ray-tracing weights step backwards where two sections share a pixel: a new tap.
            if lane >= 4 || filled[lane] {
                break;
            }
            filled[lane] = true;
            tap.shares[lane] = piece.weight;
            (part.u0[lane], part.u1[lane]) = (piece.u0, piece.u1);
            part.low = part.low.min(piece.u0);
            part.high = part.high.max(piece.u1);
            n += 1;
        }
        taps.push(tap);
        if circle {
            parts.push(part);
        }
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
                Columns::new(footprint, z, voxels.iter().map(|index| (index % nx as u64) as usize), circle)
            })
            .collect();
        let mut this = Self {
            circle,
            lines,
            profiles: Vec::with_capacity(indices.len()),
            ranges: Vec::new(),
            sums: Vec::new(),
            taps: Vec::new(),
            parts: Vec::new(),
            row_taps: Vec::new(),
            line_sums: Vec::new(),
            row_starts: Vec::new(),
            sources: Vec::new(),
            source_starts: Vec::new(),
            subsets,
            scale: footprint.scale() * if circle { std::f32::consts::FRAC_PI_4 } else { 1.0 },
        };
        for slice in slices {
            let (first_tap, first_range) = (this.taps.len() as u32, this.ranges.len() as u32);
            this.profiles.extend(slice.profiles.iter().map(|profile| first_range + profile));
            this.ranges.extend(slice.ranges.iter().map(|(first, end)| (first_tap + first, first_tap + end)));
            this.sums.extend(slice.sums);
            this.taps.extend(slice.taps);
            this.parts.extend(slice.parts);
        }
        this.fill_rows(footprint, ny, nz);
        this
    }

    fn fill_rows(&mut self, footprint: &Footprint, ny: usize, nz: usize) {
        let subsets = self.subsets;
        let lines = &self.lines;
        let slices: Vec<(Vec<RowTap>, Vec<u32>, Vec<f32>)> = (0..nz)
            .into_par_iter()
            .map(|z| {
                let (mut taps, mut starts, mut sums, mut pieces) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
                for y in 0..ny {
                    pieces.clear();
                    if lines[ny * z + y] < lines[ny * z + y + 1] {
                        footprint.rows(y, z, &mut pieces);
                    }
                    pieces.sort_by_key(|piece| piece.pixel as usize % subsets);
                    sums.push(pieces.iter().map(|piece| piece.weight).sum());
                    let mut subset = 0;
                    for piece in &pieces {
                        while subset <= piece.pixel as usize % subsets {
                            starts.push(taps.len() as u32);
                            subset += 1;
                        }
                        let share = footprint.scale() * piece.weight;
                        taps.push(RowTap { row: piece.pixel, share, chords: footprint.chords(piece) });
                    }
                    while subset <= subsets {
                        starts.push(taps.len() as u32);
                        subset += 1;
                    }
                }
                (taps, starts, sums)
            })
            .collect();
        for (taps, starts, sums) in slices {
            let first = self.row_taps.len() as u32;
            self.row_starts.extend(starts.iter().map(|start| first + start));
            self.row_taps.extend(taps);
            self.line_sums.extend(sums);
        }
        // The same taps by image row, lines in rising order.
        let (_, height) = footprint.sensor();
        let mut starts = vec![0u32; height + 1];
        for tap in &self.row_taps {
            starts[tap.row as usize + 1] += 1;
        }
        for row in 0..height {
            starts[row + 1] += starts[row];
        }
        let mut next = starts.clone();
        self.sources = vec![Source { line: 0, tap: 0 }; self.row_taps.len()];
        for line in 0..ny * nz {
            let first = self.row_starts[line * (subsets + 1)];
            let end = self.row_starts[line * (subsets + 1) + subsets];
            for tap in first..end {
                let place = &mut next[self.row_taps[tap as usize].row as usize];
                self.sources[*place as usize] = Source { line: line as u32, tap };
                *place += 1;
            }
        }
        self.source_starts = starts;
    }

    /// Forgets the voxels that are not held; what is known of the others stays.
    pub(crate) fn retain(&mut self, held: &[bool]) {
        crate::subsets::keep(&mut self.profiles, held);
        let (mut kept, mut n) = (0, 0);
        for end in &mut self.lines {
            kept += held[n..*end as usize].iter().filter(|held| **held).count() as u32;
            n = *end as usize;
            *end = kept;
        }
    }

    /// Image rows are the things written: each is one thread's, and its sources come in a fixed order.
    pub(crate) fn project(&self, rows: Rows, strengths: &[f32], plane: &mut Plane) {
        let wanted = plane.values.par_chunks_mut(plane.stride).enumerate();
        wanted.filter(|(row, _)| row % rows.subsets == rows.subset).for_each(|(row, out)| {
            out.fill(0.0);
            for source in &self.sources[self.source_starts[row] as usize..self.source_starts[row + 1] as usize] {
                let tap = &self.row_taps[source.tap as usize];
                let line = self.lines[source.line as usize] as usize..self.lines[source.line as usize + 1] as usize;
                for (strength, profile) in strengths[line.clone()].iter().zip(&self.profiles[line]) {
                    let (first, end) = self.ranges[*profile as usize];
                    let light = tap.share * strength;
                    let taps = first as usize..end as usize;
                    if self.circle {
                        add_cut(out, light, &self.taps[taps.clone()], &self.parts[taps], &tap.chords);
                    } else {
                        add(out, light, &self.taps[taps]);
                    }
                }
            }
        });
    }

    /// What a round stop cuts from a voxel at the edge of sight is taken to be what it cuts from others.
    pub(crate) fn shares(&self) -> Vec<f32> {
        let mut shares = Vec::with_capacity(self.profiles.len());
        for (line, sum) in self.line_sums.iter().enumerate() {
            let voxels = &self.profiles[self.lines[line] as usize..self.lines[line + 1] as usize];
            shares.extend(voxels.iter().map(|profile| self.scale * sum * self.sums[*profile as usize]));
        }
        shares
    }

    /// Slices' strengths are the things written; lines of a slice share row taps.
    pub(crate) fn back_project(
        &self,
        rows: Rows,
        plane: &Plane,
        strengths: &mut [f32],
        update: impl Fn(usize, &mut f32, f32, f32) + Sync,
    ) {
        // Runs of about equal work, cut between lines; how they are cut cannot change a sum.
        const RUN: usize = 4096;
        let mut runs: Vec<(usize, usize, &mut [f32])> = Vec::new();
        let (mut rest, mut first) = (strengths, 0);
        for line in 0..self.lines.len() - 1 {
            let length = (self.lines[line + 1] - self.lines[first]) as usize;
            if length >= RUN || line + 2 == self.lines.len() {
                let (run, tail) = rest.split_at_mut(length);
                runs.push((first, line + 1, run));
                (rest, first) = (tail, line + 1);
            }
        }
        runs.into_par_iter().for_each(|(first, end, run)| {
            let base = self.lines[first] as usize;
            for line in first..end {
                let at = line * (self.subsets + 1) + rows.subset;
                let taps = &self.row_taps[self.row_starts[at] as usize..self.row_starts[at + 1] as usize];
                if taps.is_empty() {
                    continue;
                }
                for n in self.lines[line] as usize..self.lines[line + 1] as usize {
                    let (first, end) = self.ranges[self.profiles[n] as usize];
                    let columns = first as usize..end as usize;
                    let (mut sum, mut weight) = (0.0, 0.0);
                    for tap in taps {
                        let values = &plane.values[tap.row as usize * plane.stride..][..plane.stride];
                        let (s, w) = if self.circle {
                            gather_cut(values, &self.taps[columns.clone()], &self.parts[columns.clone()], &tap.chords)
                        } else {
                            gather(values, &self.taps[columns.clone()])
                        };
                        sum += tap.share * s;
                        weight += tap.share * w;
                    }
                    update(n, &mut run[n - base], sum, weight);
                }
            }
        });
    }
}

#[inline]
fn lanes(values: &[f32], column: u32) -> [f32; 4] {
    values[column as usize..column as usize + 4].try_into().expect("four lanes")
}

#[inline]
fn add(out: &mut [f32], light: f32, taps: &[Tap]) {
    for tap in taps {
        let four = &mut out[tap.column as usize..tap.column as usize + 4];
        for lane in 0..4 {
            four[lane] += light * tap.shares[lane];
        }
    }
}

#[inline]
fn gather(values: &[f32], taps: &[Tap]) -> (f32, f32) {
    let (mut sum, mut weight) = ([0f32; 4], [0f32; 4]);
    for tap in taps {
        let four = lanes(values, tap.column);
        for lane in 0..4 {
            sum[lane] += four[lane] * tap.shares[lane];
            weight[lane] += tap.shares[lane];
        }
    }
    (sum.iter().sum(), weight.iter().sum())
}

/// Shares of a tap inside the stop; none where it is wholly outside.
#[inline]
fn cut(tap: &Tap, parts: &Parts, chords: &Chords) -> Option<[f32; 4]> {
    if (-parts.low).max(parts.high) <= chords.inner {
        return Some(tap.shares);
    }
    if parts.low >= chords.outer || parts.high <= -chords.outer {
        return None;
    }
    let mut shares = tap.shares;
    for lane in 0..4 {
        if shares[lane] > 0.0 {
            shares[lane] *= chords.share(parts.u0[lane], parts.u1[lane]);
        }
    }
    Some(shares)
}

#[inline]
fn add_cut(out: &mut [f32], light: f32, taps: &[Tap], parts: &[Parts], chords: &Chords) {
    for (tap, parts) in taps.iter().zip(parts) {
        if let Some(shares) = cut(tap, parts, chords) {
            let four = &mut out[tap.column as usize..tap.column as usize + 4];
            for lane in 0..4 {
                four[lane] += light * shares[lane];
            }
        }
    }
}

#[inline]
fn gather_cut(values: &[f32], taps: &[Tap], parts: &[Parts], chords: &Chords) -> (f32, f32) {
    let (mut sum, mut weight) = ([0f32; 4], [0f32; 4]);
    for (tap, parts) in taps.iter().zip(parts) {
        if let Some(shares) = cut(tap, parts, chords) {
            let four = lanes(values, tap.column);
            for lane in 0..4 {
                sum[lane] += four[lane] * shares[lane];
                weight[lane] += shares[lane];
            }
        }
    }
    (sum.iter().sum(), weight.iter().sum())
}
