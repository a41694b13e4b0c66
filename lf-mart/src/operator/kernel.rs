//! Column profiles and the two inner loops over them, for the widest vectors of the machine: spread a strength onto
//! image rows, gather from them. No branch in the loops depends on data.

#[cfg(target_arch = "x86_64")]
use super::kernel_avx2;
use super::stencils::{CutStencil, LitRows, Stencil, fill, halves};
use super::{kernel_portable, plane::PADDING};
use lf_core::{simd::Level, weights::Piece};
use std::ops::Range;

/// A column profile.
#[derive(Debug)]
pub(super) struct Profile {
    first_stencil: u32,
    end_stencil: u32,
    /// Sum of its shares.
    pub(super) sum: f32,
    /// Number of its shares.
    pub(super) count: u32,
}

/// Column profiles, numbered in the order in which they are pushed.
#[derive(Debug)]
pub(super) struct ColumnProfiles {
    width: usize,
    has_round_stop: bool,
    level: Level,
    pub(super) profiles: Vec<Profile>,
    stencils: Vec<Stencil>,
    cut_stencils: Vec<CutStencil>,
}

impl ColumnProfiles {
    pub(super) fn new(width: usize, has_round_stop: bool) -> Self {
        let level = Level::detect();
        Self { width, has_round_stop, level, profiles: Vec::new(), stencils: Vec::new(), cut_stencils: Vec::new() }
    }

    /// Appends a profile.
    pub(super) fn push(&mut self, pieces: &[Piece]) {
        assert!(pieces.iter().all(|piece| (piece.pixel as usize) < self.width), "a column outside the image");
        let first_stencil = self.count_stencils();
        if self.has_round_stop {
            fill(&halves(pieces), &mut self.cut_stencils);
        } else {
            fill(pieces, &mut self.stencils);
        }
        let sum = pieces.iter().map(|piece| piece.weight).sum();
        self.profiles.push(Profile {
            first_stencil,
            end_stencil: self.count_stencils(),
            sum,
            count: pieces.len() as u32,
        });
    }

    fn count_stencils(&self) -> u32 {
        (self.stencils.len() + self.cut_stencils.len()) as u32
    }

    pub(super) fn reserve<'a>(&mut self, others: impl Iterator<Item = &'a Self> + Clone) {
        self.profiles.reserve_exact(others.clone().map(|other| other.profiles.len()).sum());
        self.stencils.reserve_exact(others.clone().map(|other| other.stencils.len()).sum());
        self.cut_stencils.reserve_exact(others.map(|other| other.cut_stencils.len()).sum());
    }

    pub(super) fn append(&mut self, other: Self) {
        let is_alike = other.width == self.width && other.has_round_stop == self.has_round_stop;
        assert!(is_alike, "profiles of another image");
        let base = self.count_stencils();
        let moved =
            |p: Profile| Profile { first_stencil: base + p.first_stencil, end_stencil: base + p.end_stencil, ..p };
        self.profiles.extend(other.profiles.into_iter().map(moved));
        self.stencils.extend(other.stencils);
        self.cut_stencils.extend(other.cut_stencils);
    }

    #[inline(always)]
    fn stencils(&self, number: u32) -> Range<usize> {
        let profile = &self.profiles[number as usize];
        profile.first_stencil as usize..profile.end_stencil as usize
    }

    #[inline(always)]
    fn check(&self, rows: &LitRows, plane: &[f32]) {
        assert!(rows.last + self.width + PADDING <= plane.len(), "a row outside the plane");
    }

    /// Adds the light of a voxel with profile `number` to rows of `plane`.
    #[inline(always)]
    pub(super) fn spread(&self, number: u32, strength: f32, rows: &LitRows, plane: &mut [f32]) {
        self.check(rows, plane);
        let (stencils, rows) = (self.stencils(number), rows.rows.as_slice());
        // SAFETY: `push` checked that columns are less than the width, `check` that rows lie in the plane; the machine
        // has the level.
        unsafe {
            match (self.has_round_stop, self.level) {
                #[cfg(target_arch = "x86_64")]
                (false, Level::Avx2Fma) => kernel_avx2::spread_whole(plane, strength, rows, &self.stencils[stencils]),
                (false, _) => kernel_portable::spread_whole(plane, strength, rows, &self.stencils[stencils]),
                #[cfg(target_arch = "x86_64")]
                (true, Level::Avx2Fma) => kernel_avx2::spread_cut(plane, strength, rows, &self.cut_stencils[stencils]),
                (true, _) => kernel_portable::spread_cut(plane, strength, rows, &self.cut_stencils[stencils]),
            }
        }
    }

    /// The weighted sum over rows of `plane` for a voxel with profile `number`, and the sum of its weights.
    #[inline(always)]
    pub(super) fn gather(&self, number: u32, rows: &LitRows, plane: &[f32]) -> (f32, f32) {
        self.check(rows, plane);
        let (stencils, rows, sum) = (self.stencils(number), rows.rows.as_slice(), self.profiles[number as usize].sum);
        // SAFETY: as in `spread`.
        unsafe {
            match (self.has_round_stop, self.level) {
                #[cfg(target_arch = "x86_64")]
                (false, Level::Avx2Fma) => kernel_avx2::gather_whole(plane, rows, &self.stencils[stencils], sum),
                (false, _) => kernel_portable::gather_whole(plane, rows, &self.stencils[stencils], sum),
                #[cfg(target_arch = "x86_64")]
                (true, Level::Avx2Fma) => kernel_avx2::gather_cut(plane, rows, &self.cut_stencils[stencils]),
                (true, _) => kernel_portable::gather_cut(plane, rows, &self.cut_stencils[stencils]),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::stencils::LitRow;
    use super::*;
    use lf_core::weights::Chords;

    /// Machines without eight lanes take the other loops. The sums agree within rounding.
    #[test]
    fn four_lanes_and_eight_give_the_same_sums() {
        let width = 60;
        // Columns out of order, a part across the middle of the aperture, and a chief ray without width.
        let piece = |pixel, weight, u0, u1| Piece { pixel, weight, u0, u1 };
        let pieces: Vec<Piece> = (0..23u32)
            .map(|n| piece(n * n * 7 % 60, 0.01 * (n + 1) as f32, n as f32 * 4.0 - 50.0, n as f32 * 4.0 - 46.5))
            .chain([piece(59, 0.3, 20.0, 20.0)])
            .collect();
        let mut rows = LitRows::default();
        for (row, v0) in [-49.0, -20.0, -1.0, 33.0].into_iter().enumerate() {
            let chords = Chords::of_disc(50.0, v0, v0 + 3.5);
            rows.push(LitRow { start: row * (width + PADDING), share: 0.1 + row as f32, chords });
        }
        let image: Vec<f32> = (0..4 * (width + PADDING)).map(|n| (n * n % 17) as f32).collect();
        for has_round_stop in [false, true] {
            let mut profiles = ColumnProfiles::new(width, has_round_stop);
            profiles.push(&pieces);
            let both = [Level::Portable, Level::detect()].map(|level| {
                profiles.level = level;
                let mut plane = vec![1.0; image.len()];
                profiles.spread(0, 2.0, &rows, &mut plane);
                (plane, profiles.gather(0, &rows, &image))
            });
            let [(four, (sum, weight)), (eight, (wide_sum, wide_weight))] = both;
            assert!(four.iter().zip(&eight).all(|(a, b)| (a - b).abs() < 1e-5 * a), "{has_round_stop}");
            assert!((sum - wide_sum).abs() < 1e-5 * sum, "{has_round_stop}");
            assert!((weight - wide_weight).abs() < 1e-5 * weight, "{has_round_stop}");
            assert!(sum > 1.0 && four.iter().any(|value| *value > 1.1), "{has_round_stop}: {sum}");
        }
    }

    /// A number from 0 to 1 that looks random.
    fn part(n: &mut u64) -> f32 {
        *n = n.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*n >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Any width, any pieces in any order, any rows that end with the plane: eight lanes give what four give.
    #[test]
    fn vectors_equal_their_scalar_twins_for_any_pieces_and_rows() {
        let mut random = 7u64;
        for case in 0..400 {
            let width = 1 + (part(&mut random) * 70.0) as usize;
            let count = (part(&mut random) * 40.0) as usize;
            let mut column = 0u32;
            let pieces: Vec<Piece> = (0..count)
                .map(|_| {
                    let is_next = part(&mut random) < 0.7;
                    column = if is_next { column + 1 } else { (part(&mut random) * 70.0) as u32 } % width as u32;
                    let u0 = 120.0 * part(&mut random) - 60.0;
                    let span = if part(&mut random) < 0.1 { 0.0 } else { 8.0 * part(&mut random) };
                    Piece { pixel: column, weight: part(&mut random), u0, u1: u0 + span }
                })
                .collect();
            let height = 1 + (part(&mut random) * 6.0) as usize;
            let mut rows = LitRows::default();
            for row in 0..height {
                let v0 = 110.0 * part(&mut random) - 55.0;
                let chords = Chords::of_disc(50.0, f64::from(v0), f64::from(v0) + 3.5);
                rows.push(LitRow { start: row * (width + PADDING), share: part(&mut random), chords });
            }
            let image: Vec<f32> = (0..height * (width + PADDING)).map(|_| part(&mut random)).collect();
            for has_round_stop in [false, true] {
                let mut profiles = ColumnProfiles::new(width, has_round_stop);
                profiles.push(&pieces);
                let [(four, sums), (eight, wide)] = [Level::Portable, Level::detect()].map(|level| {
                    profiles.level = level;
                    let mut plane = vec![1.0; image.len()];
                    profiles.spread(0, 2.0, &rows, &mut plane);
                    (plane, profiles.gather(0, &rows, &image))
                });
                let close = |a: f32, b: f32| (a - b).abs() <= 2e-5 * a.abs().max(1e-3);
                assert!(four.iter().zip(&eight).all(|(a, b)| close(*a, *b)), "{case} {has_round_stop}");
                assert!(close(sums.0, wide.0) && close(sums.1, wide.1), "{case}: {sums:?} {wide:?}");
            }
        }
    }
}
