//! The two inner loops over products of profiles: spread a strength onto image rows, gather from them.
//!
//! Columns stand in runs of four, the lanes of the narrowest vector unit, two runs to a tap; no branch depends on data.

#[cfg(target_arch = "x86_64")]
use crate::kernel_avx;
use lf_core::weights::{Chords, Piece};

/// Two runs of four columns and their shares.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tap {
    pub(crate) columns: [u32; 2],
    pub(crate) shares: [f32; 8],
}

/// Two runs of four columns, cut by a round stop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CutTap {
    pub(crate) columns: [u32; 2],
    /// Distance from the middle of the aperture at which the part behind a column begins, mm.
    pub(crate) from: [f32; 8],
    /// Width of that part, mm.
    pub(crate) width: [f32; 8],
    /// Share of the light over 18 widths: the weights of [`Chords::nodes`] sum to 18.
    pub(crate) density: [f32; 8],
}

/// A part of no width, as the chief ray of a section is, is given this one, mm: it is inside or outside.
const LEAST_WIDTH: f32 = 1e-30;

/// A run of a tap begins, at a column, or goes on: called with the half, the lane of 8 and the piece.
trait Taken: Copy {
    const NONE: Self;
    fn begin(&mut self, half: usize, column: u32);
    fn set(&mut self, lane: usize, piece: &Piece);
}

impl Taken for Tap {
    const NONE: Self = Self { columns: [0; 2], shares: [0.0; 8] };

    fn begin(&mut self, half: usize, column: u32) {
        self.columns[half] = column;
    }

    fn set(&mut self, lane: usize, piece: &Piece) {
        self.shares[lane] = piece.weight;
    }
}

impl Taken for CutTap {
    const NONE: Self = Self { columns: [0; 2], from: [0.0; 8], width: [0.0; 8], density: [0.0; 8] };

    fn begin(&mut self, half: usize, column: u32) {
        self.columns[half] = column;
    }

    /// The part lies on one side of the middle.
    fn set(&mut self, lane: usize, piece: &Piece) {
        let near = piece.u0.max(-piece.u1).max(0.0);
        self.width[lane] = (piece.u1 - piece.u0).max(LEAST_WIDTH);
        // What touches the chord from within is inside.
        self.from[lane] = if piece.u1 > piece.u0 { near } else { near.next_down() };
        self.density[lane] = piece.weight / (18.0 * self.width[lane]);
    }
}

/// The pieces, those across the middle of the aperture cut in two there.
fn halves(pieces: &[Piece]) -> Vec<Piece> {
    let cut = |piece: &Piece| {
        if piece.u0 >= 0.0 || piece.u1 <= 0.0 {
            return [Some(*piece), None];
        }
        let left = piece.weight * piece.u0 / (piece.u0 - piece.u1);
        [
            Some(Piece { weight: left, u1: 0.0, ..*piece }),
            Some(Piece { weight: piece.weight - left, u0: 0.0, ..*piece }),
        ]
    };
    pieces.iter().flat_map(cut).flatten().collect()
}

/// Appends pieces as taps.
fn take<T: Taken>(pieces: &[Piece], taps: &mut Vec<T>) {
    let (mut column, mut filled, mut half) = (0, [true; 4], 1);
    for piece in pieces {
        let mut lane = piece.pixel.wrapping_sub(column) as usize;
        // Dense-ray-tracing weights step backwards where two sections share a pixel: a new run.
        if lane >= 4 || filled[lane] {
            (column, filled, half, lane) = (piece.pixel, [false; 4], 1 - half, 0);
            if half == 0 {
                taps.push(T::NONE);
            }
            taps.last_mut().expect("one was begun").begin(half, column);
        }
        filled[lane] = true;
        taps.last_mut().expect("one was begun").set(4 * half + lane, piece);
    }
}

/// A place in a plane where an image row begins, and the row's share of the light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    pub(crate) start: usize,
    pub(crate) share: f32,
    pub(crate) chords: Chords,
}

impl CutTap {
    /// What the stop leaves of each share.
    #[inline(always)]
    fn inside(&self, chords: &Chords) -> [f32; 8] {
        // `f32::clamp` cares for NaN, which takes longer.
        let clamp = |value: f32, most: f32| {
            let value = if value < most { value } else { most };
            if value > 0.0 { value } else { 0.0 }
        };
        let [a, b, c] = chords.nodes;
        let mut shares = [0.0; 8];
        for lane in 0..8 {
            let (from, width) = (self.from[lane], self.width[lane]);
            let ends = clamp(a - from, width) + clamp(c - from, width);
            shares[lane] = self.density[lane] * (5.0 * ends + 8.0 * clamp(b - from, width));
        }
        shares
    }
}

/// The four values at a column.
///
/// # Safety
/// `from + 4 <= values.len()`.
#[inline(always)]
unsafe fn four(values: &[f32], from: usize) -> [f32; 4] {
    debug_assert!(from + 4 <= values.len());
    // SAFETY: as the caller says; an array of four f32 needs the alignment of one.
    unsafe { *values.as_ptr().add(from).cast() }
}

/// The image rows that a line of voxels lights.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    lines: Vec<Line>,
    /// Where the last of them begins.
    last: usize,
}

impl Lines {
    pub(crate) fn clear(&mut self) {
        self.lines.clear();
        self.last = 0;
    }

    pub(crate) fn push(&mut self, line: Line) {
        self.last = self.last.max(line.start);
        self.lines.push(line);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }
}

/// Column profiles, numbered as they come.
#[derive(Debug)]
pub(crate) struct Profiles {
    /// Columns of the image.
    width: usize,
    circle: bool,
    wide: bool,
    /// First and end tap of each.
    ranges: Vec<(u32, u32)>,
    /// Sum of each one's shares.
    pub(crate) sums: Vec<f32>,
    /// Shares of each one.
    pub(crate) counts: Vec<u32>,
    taps: Vec<Tap>,
    cut_taps: Vec<CutTap>,
}

impl Profiles {
    pub(crate) fn new(width: usize, circle: bool) -> Self {
        let wide = wide();
        Self {
            width,
            circle,
            wide,
            ranges: Vec::new(),
            sums: Vec::new(),
            counts: Vec::new(),
            taps: Vec::new(),
            cut_taps: Vec::new(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.ranges.len()
    }

    pub(crate) fn push(&mut self, pieces: &[Piece]) {
        assert!(pieces.iter().all(|piece| (piece.pixel as usize) < self.width), "a column outside the image");
        let first = self.count_taps();
        if self.circle {
            take(&halves(pieces), &mut self.cut_taps);
        } else {
            take(pieces, &mut self.taps);
        }
        self.ranges.push((first, self.count_taps()));
        self.counts.push(pieces.len() as u32);
        self.sums.push(pieces.iter().map(|piece| piece.weight).sum());
    }

    fn count_taps(&self) -> u32 {
        (self.taps.len() + self.cut_taps.len()) as u32
    }

    /// Room for what others hold.
    pub(crate) fn reserve<'a>(&mut self, others: impl Iterator<Item = &'a Self> + Clone) {
        self.ranges.reserve_exact(others.clone().map(|other| other.ranges.len()).sum());
        self.counts.reserve_exact(others.clone().map(|other| other.counts.len()).sum());
        self.sums.reserve_exact(others.clone().map(|other| other.sums.len()).sum());
        self.taps.reserve_exact(others.clone().map(|other| other.taps.len()).sum());
        self.cut_taps.reserve_exact(others.map(|other| other.cut_taps.len()).sum());
    }

    pub(crate) fn append(&mut self, other: Self) {
        assert!(other.width == self.width && other.circle == self.circle, "profiles of another image");
        let base = self.count_taps();
        self.ranges.extend(other.ranges.iter().map(|(first, end)| (base + first, base + end)));
        self.sums.extend(other.sums);
        self.counts.extend(other.counts);
        self.taps.extend(other.taps);
        self.cut_taps.extend(other.cut_taps);
    }

    #[inline(always)]
    fn profile(&self, number: u32) -> Profile<'_> {
        let (first, end) = self.ranges[number as usize];
        let taps = first as usize..end as usize;
        if self.circle {
            Profile::Cut(&self.cut_taps[taps])
        } else {
            Profile::Whole(&self.taps[taps], self.sums[number as usize])
        }
    }

    #[inline(always)]
    fn check(&self, lines: &Lines, plane: &[f32]) {
        assert!(lines.last + self.width + PADDING <= plane.len(), "a line outside the plane");
    }

    /// Adds the light of a voxel of a profile to lines of `plane`.
    #[inline(always)]
    pub(crate) fn spread(&self, number: u32, strength: f32, lines: &Lines, plane: &mut [f32]) {
        self.check(lines, plane);
        // SAFETY: columns are less than the width, as pushed, and lines lie in the plane, as checked.
        unsafe { spread(plane, strength, &lines.lines, self.profile(number), self.wide) }
    }

    /// The weighted sum over lines of `plane` for a voxel of a profile, and the sum of its weights.
    #[inline(always)]
    pub(crate) fn gather(&self, number: u32, lines: &Lines, plane: &[f32]) -> (f32, f32) {
        self.check(lines, plane);
        // SAFETY: as in `spread`.
        unsafe { gather(plane, &lines.lines, self.profile(number), self.wide) }
    }
}

/// Values that a row of a plane has beyond the image's columns: four lanes fit at any column.
pub(crate) const PADDING: usize = 4;

/// A column profile.
#[derive(Debug, Clone, Copy)]
enum Profile<'a> {
    /// Of a square stop, and the sum of its shares.
    Whole(&'a [Tap], f32),
    /// Of a round one.
    Cut(&'a [CutTap]),
}

/// Whether the machine has eight lanes and fused operations.
fn wide() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

/// Adds a voxel's light to lines of `plane`.
///
/// # Safety
/// Every line's start, with every tap's column and 4 more, lies in the plane. `wide` is no more than [`wide()`] says.
#[inline(always)]
unsafe fn spread(plane: &mut [f32], strength: f32, lines: &[Line], profile: Profile, wide: bool) {
    match profile {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as the caller says.
        Profile::Whole(taps, _) if wide => unsafe { kernel_avx::spread_whole(plane, strength, lines, taps) },
        Profile::Whole(taps, _) => {
            for line in lines {
                let light = line.share * strength;
                for tap in taps {
                    // SAFETY: as the caller says.
                    unsafe { add(plane, line.start, tap.columns, light, &tap.shares) };
                }
            }
        }
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as the caller says.
        Profile::Cut(taps) if wide => unsafe { kernel_avx::spread_cut(plane, strength, lines, taps) },
        Profile::Cut(taps) => {
            for line in lines {
                let light = line.share * strength;
                for tap in taps {
                    // SAFETY: as the caller says.
                    unsafe { add(plane, line.start, tap.columns, light, &tap.inside(&line.chords)) };
                }
            }
        }
    }
}

/// Adds shares of light at two runs of columns of a line, which may overlap.
///
/// # Safety
/// As for [`spread`].
#[inline(always)]
unsafe fn add(plane: &mut [f32], start: usize, columns: [u32; 2], light: f32, shares: &[f32; 8]) {
    for half in 0..2 {
        let from = start + columns[half] as usize;
        debug_assert!(from + 4 <= plane.len());
        // SAFETY: as the caller says; an array of four f32 needs the alignment of one.
        let out = unsafe { &mut *plane.as_mut_ptr().add(from).cast::<[f32; 4]>() };
        for lane in 0..4 {
            out[lane] += light * shares[4 * half + lane];
        }
    }
}

/// A voxel's weighted sum over lines of `plane`, and the sum of the weights.
///
/// # Safety
/// As for [`spread`].
#[inline(always)]
unsafe fn gather(plane: &[f32], lines: &[Line], profile: Profile, wide: bool) -> (f32, f32) {
    match profile {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as the caller says.
        Profile::Whole(taps, sum) if wide => unsafe { kernel_avx::gather_whole(plane, lines, taps, sum) },
        Profile::Whole(taps, sum) => {
            let (mut all, mut weight) = (0.0, 0.0);
            for line in lines {
                let mut part = [0f32; 4];
                for tap in taps {
                    for half in 0..2 {
                        // SAFETY: as the caller says.
                        let values = unsafe { four(plane, line.start + tap.columns[half] as usize) };
                        for lane in 0..4 {
                            part[lane] += values[lane] * tap.shares[4 * half + lane];
                        }
                    }
                }
                all += line.share * part.iter().sum::<f32>();
                weight += line.share * sum;
            }
            (all, weight)
        }
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as the caller says.
        Profile::Cut(taps) if wide => unsafe { kernel_avx::gather_cut(plane, lines, taps) },
        Profile::Cut(taps) => {
            let (mut all, mut weight) = (0.0, 0.0);
            for line in lines {
                let (mut part, mut cut) = ([0f32; 4], [0f32; 4]);
                for tap in taps {
                    let shares = tap.inside(&line.chords);
                    for half in 0..2 {
                        // SAFETY: as the caller says.
                        let values = unsafe { four(plane, line.start + tap.columns[half] as usize) };
                        for lane in 0..4 {
                            part[lane] += values[lane] * shares[4 * half + lane];
                            cut[lane] += shares[4 * half + lane];
                        }
                    }
                }
                all += line.share * part.iter().sum::<f32>();
                weight += line.share * cut.iter().sum::<f32>();
            }
            (all, weight)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Machines without eight lanes take the other loops: the same sums but for rounding.
    #[test]
    fn four_lanes_and_eight_do_the_same() {
        let width = 60;
        // Two lenslets out of line, one part across the middle of the aperture, a chief ray without width.
        let piece = |pixel, weight, u0, u1| Piece { pixel, weight, u0, u1 };
        let pieces: Vec<Piece> = (0..23u32)
            .map(|n| piece(n * n * 7 % 60, 0.01 * (n + 1) as f32, n as f32 * 4.0 - 50.0, n as f32 * 4.0 - 46.5))
            .chain([piece(59, 0.3, 20.0, 20.0)])
            .collect();
        let mut lines = Lines::default();
        for (row, v0) in [-49.0, -20.0, -1.0, 33.0].into_iter().enumerate() {
            let chords = Chords::of_disc(50.0, v0, v0 + 3.5);
            lines.push(Line { start: row * (width + PADDING), share: 0.1 + row as f32, chords });
        }
        let image: Vec<f32> = (0..4 * (width + PADDING)).map(|n| (n * n % 17) as f32).collect();
        for circle in [false, true] {
            let mut profiles = Profiles::new(width, circle);
            profiles.push(&pieces);
            let both = [false, true].map(|lanes| {
                profiles.wide = lanes && wide();
                let mut plane = vec![1.0; image.len()];
                profiles.spread(0, 2.0, &lines, &mut plane);
                (plane, profiles.gather(0, &lines, &image))
            });
            let [(four, (sum, weight)), (eight, (wide_sum, wide_weight))] = both;
            assert!(four.iter().zip(&eight).all(|(a, b)| (a - b).abs() < 1e-5 * a), "{circle}");
            assert!((sum - wide_sum).abs() < 1e-5 * sum && (weight - wide_weight).abs() < 1e-5 * weight, "{circle}");
            assert!(sum > 1.0 && four.iter().any(|value| *value > 1.1), "{circle}: {sum}");
        }
    }
}
