//! The inner loops: spread a voxel's strength over rows of micro-images, gather a voxel's share of them.

use super::hits::{Group, Hit, HitList, Hits, ROOM};
use super::images::MicroLayout;
use super::patches::{FOUR, Patches};
use super::walk::LightSink;
use super::wide::WideRow;
use glam::Vec4;

/// Adds light to micro-images.
pub(super) struct Spread<'a> {
    pub(super) layout: MicroLayout,
    pub(super) patches: Option<&'a Patches>,
    pub(super) strengths: &'a [f32],
    pub(super) values: &'a mut [f32],
}

/// Sums what voxels see in micro-images.
pub(super) struct Gather<'a> {
    pub(super) layout: MicroLayout,
    pub(super) patches: Option<&'a Patches>,
    pub(super) values: &'a [f32],
    /// Four parts of the sum of each voxel.
    pub(super) sums: &'a mut [Vec4],
    /// Approximately the sum of each voxel's weights times the stop's area in pixels.
    pub(super) weights: &'a mut [f32],
    pub(super) running: &'a mut RunningSums,
}

/// Sums that run on over hits: over all, over those that the stop may cut, and of their weights. The first is 0.
#[derive(Debug)]
pub(super) struct RunningSums {
    all: [Vec4; ROOM + 1],
    cut: [Vec4; ROOM + 1],
    weights: [f32; ROOM + 1],
}

impl RunningSums {
    pub(super) fn new() -> Self {
        Self { all: [Vec4::ZERO; ROOM + 1], cut: [Vec4::ZERO; ROOM + 1], weights: [0.0; ROOM + 1] }
    }
}

/// Counts weights.
pub(super) struct Count {
    /// Columns of a patch.
    pub(super) columns: usize,
    pub(super) weights: usize,
}

impl LightSink for Count {
    #[inline(always)]
    fn add_hits(&mut self, hits: &Hits) {
        self.weights += self.columns * hits.all.count;
    }

    fn add_row(&mut self, _: usize, _: &WideRow, _: usize, _: usize) {
        self.weights += self.columns;
    }
}

/// Four values.
///
/// # Safety
/// There are `place + 4` values.
#[inline(always)]
unsafe fn four(values: &[f32], place: usize) -> Vec4 {
    debug_assert!(place + FOUR <= values.len());
    // SAFETY: the caller's promise.
    Vec4::from_array(unsafe { values.as_ptr().add(place).cast::<[f32; FOUR]>().read() })
}

/// Four shares, interpolated by `part` from one phase to the next, which is stored `columns` behind.
///
/// # Safety
/// There are `place + columns + 4` shares.
#[inline(always)]
unsafe fn between(shares: &[f32], place: usize, columns: usize, part: f32) -> Vec4 {
    // SAFETY: the caller's promise.
    unsafe {
        let (a, b) = (four(shares, place), four(shares, place + columns));
        a + part * (b - a)
    }
}

/// Adds to four values.
///
/// # Safety
/// There are `place + 4` values.
#[inline(always)]
unsafe fn add(values: &mut [f32], place: usize, light: Vec4) {
    // SAFETY: the caller's promise.
    unsafe {
        let sum = four(values, place) + light;
        values.as_mut_ptr().add(place).cast::<[f32; FOUR]>().write(sum.to_array());
    }
}

/// Fours of a large patch's row that touch the micro-image: first and end column.
#[inline(always)]
fn fours(column: i32, columns: usize, side: usize) -> (usize, usize) {
    let first = (-column).max(0) as usize / FOUR * FOUR;
    (first, ((side as i32 - column).max(0) as usize).next_multiple_of(FOUR).min(columns))
}

/// Rows of large patches, part `number` of the light: the voxel, a place in the micro-images, and the shares from there
/// on.
#[inline(always)]
fn large_rows<'a>(
    patches: &'a Patches,
    layout: MicroLayout,
    (list, table): (&'a HitList, &'a [f32]),
    number: usize,
) -> impl Iterator<Item = (usize, usize, impl Iterator<Item = f32> + 'a)> + 'a {
    let columns = patches.columns;
    list.with_columns().map(
        #[inline(always)]
        move |(Hit { voxel, shares, values, part }, column)| {
            let (from, to) = fours(column, columns, layout.side);
            let row = &table[shares..];
            let [a, b] = [row, &row[columns..]].map(|row| &row[from..to.max(from)]);
            let shares = a.iter().zip(b).map(move |(a, b)| a + part * (b - a));
            (voxel, values + from + number * layout.width, shares)
        },
    )
}

/// The parts of the light: shares of all hits, and two moments of the hits that the stop may cut.
#[inline(always)]
fn large_parts<'a>(patches: &'a Patches, hits: &'a Hits) -> [(&'a HitList, &'a [f32]); 3] {
    let [by_x, by_y] = &patches.moments;
    [(&hits.all, &patches.shares), (&hits.cut, by_x), (&hits.cut, by_y)]
}

impl Spread<'_> {
    /// For patches of N times four columns, which fit beside the micro-image.
    #[inline(always)]
    fn narrow<const N: usize>(&mut self, patches: &Patches, hits: &Hits) {
        let width = self.layout.width;
        // SAFETY: hits refer to rows of the table and to places in the micro-images with room for a row of 8.
        unsafe {
            // Add the light of all hits.
            for Hit { voxel, shares, values, part } in hits.all.iter() {
                let strength = *self.strengths.get_unchecked(voxel);
                for n in 0..N {
                    let shares = between(&patches.shares, shares + n * FOUR, N * FOUR, part);
                    add(self.values, values + n * FOUR, strength * shares);
                }
            }
            // Add the moments of those that the stop may cut.
            for Hit { voxel, shares, values, part } in hits.cut.iter() {
                let strength = *self.strengths.get_unchecked(voxel);
                for n in 0..N {
                    let (shares, values) = (shares + n * FOUR, values + n * FOUR);
                    add(self.values, values + width, strength * between(&patches.moments[0], shares, N * FOUR, part));
                    add(
                        self.values,
                        values + 2 * width,
                        strength * between(&patches.moments[1], shares, N * FOUR, part),
                    );
                }
            }
        }
    }

    /// For patches of more columns, part `number` of the light.
    #[inline(always)]
    fn large(&mut self, patches: &Patches, part: (&HitList, &[f32]), number: usize) {
        for (voxel, place, shares) in large_rows(patches, self.layout, part, number) {
            let strength = self.strengths[voxel];
            self.values[place..].iter_mut().zip(shares).for_each(|(value, share)| *value += strength * share);
        }
    }
}

impl LightSink for Spread<'_> {
    #[inline(always)]
    fn add_hits(&mut self, hits: &Hits) {
        let Some(patches) = self.patches else { return };
        match patches.columns {
            4 => self.narrow::<1>(patches, hits),
            8 => self.narrow::<2>(patches, hits),
            _ => large_parts(patches, hits).into_iter().enumerate().for_each(|(n, part)| self.large(patches, part, n)),
        }
    }

    #[inline(always)]
    fn add_row(&mut self, voxel: usize, row: &WideRow, parts: usize, values: usize) {
        let strength = self.strengths[voxel];
        let (from, parts) = row.parts(parts);
        for (n, part) in parts.enumerate() {
            let values = &mut self.values[values + from + n * self.layout.width..];
            values.iter_mut().zip(part).for_each(|(value, share)| *value += strength * share);
        }
    }
}

impl Gather<'_> {
    /// For patches of N times four columns, which fit beside the micro-image.
    ///
    /// Sums run on from hit to hit, and a voxel's sum is the difference between the ends of its group. Summing voxel by
    /// voxel in memory takes twice the time.
    #[inline(always)]
    fn narrow<const N: usize>(&mut self, patches: &Patches, hits: &Hits) {
        let width = self.layout.width;
        let RunningSums { all: sums, cut: cut_sums, .. } = &mut *self.running;
        // SAFETY: hits refer to rows of the table and to places in the micro-images with room for a row of 8.
        unsafe {
            // Sum the products of light and image over all hits.
            let mut sum = Vec4::ZERO;
            for (Hit { shares, values, part, .. }, out) in hits.all.iter().zip(&mut sums[1..]) {
                for n in 0..N {
                    let shares = between(&patches.shares, shares + n * FOUR, N * FOUR, part);
                    sum += shares * four(self.values, values + n * FOUR);
                }
                *out = sum;
            }
            // Sum those of the moments over the hits that the stop may cut.
            let mut sum = Vec4::ZERO;
            for (Hit { shares, values, part, .. }, out) in hits.cut.iter().zip(&mut cut_sums[1..]) {
                for n in 0..N {
                    let (shares, values) = (shares + n * FOUR, values + n * FOUR);
                    let by_x = between(&patches.moments[0], shares, N * FOUR, part);
                    let by_y = between(&patches.moments[1], shares, N * FOUR, part);
                    sum += by_x * four(self.values, values + width) + by_y * four(self.values, values + 2 * width);
                }
                *out = sum;
            }
        }
        // Add to each voxel the difference between the ends of its group.
        let (mut from, mut from_cut) = (0, 0);
        for Group { voxel, end, end_cut } in hits.groups() {
            self.sums[*voxel] += sums[*end] - sums[from] + cut_sums[*end_cut] - cut_sums[from_cut];
            (from, from_cut) = (*end, *end_cut);
        }
    }

    /// Adds the weights.
    #[inline(always)]
    fn weigh(&mut self, patches: &Patches, hits: &Hits) {
        let (sums, mut sum) = (&mut self.running.weights, 0.0);
        for (weight, out) in hits.weights(patches).zip(&mut sums[1..]) {
            sum += weight;
            *out = sum;
        }
        let mut from = 0;
        for Group { voxel, end, .. } in hits.groups() {
            self.weights[*voxel] += sums[*end] - sums[from];
            from = *end;
        }
    }

    /// For patches of more columns, part `number` of the light.
    #[inline(always)]
    fn large(&mut self, patches: &Patches, part: (&HitList, &[f32]), number: usize) {
        for (voxel, place, shares) in large_rows(patches, self.layout, part, number) {
            let values = self.values[place..].iter();
            self.sums[voxel].x += values.zip(shares).map(|(value, share)| value * share).sum::<f32>();
        }
    }
}

impl LightSink for Gather<'_> {
    #[inline(always)]
    fn add_hits(&mut self, hits: &Hits) {
        let Some(patches) = self.patches else { return };
        match patches.columns {
            4 => self.narrow::<1>(patches, hits),
            8 => self.narrow::<2>(patches, hits),
            _ => large_parts(patches, hits).into_iter().enumerate().for_each(|(n, part)| self.large(patches, part, n)),
        }
        self.weigh(patches, hits);
    }

    #[inline(always)]
    fn add_row(&mut self, voxel: usize, row: &WideRow, parts: usize, values: usize) {
        let (from, parts) = row.parts(parts);
        for (n, part) in parts.enumerate() {
            let values = &self.values[values + from + n * self.layout.width..];
            self.sums[voxel].x += values.iter().zip(part).map(|(value, share)| value * share).sum::<f32>();
        }
        self.weights[voxel] += row.weight;
    }
}
