//! Lists of hits: rows of patches on rows of micro-images.

use super::array::LANES;
use super::patches::Patches;

/// Hits are used when there are this many, so that the loops over them are long and their branches predictable.
pub(super) const FULL: usize = 96;
/// Room for these, and for the hits that eight more lenslets may add.
pub(super) const ROOM: usize = FULL + LANES;

/// Rows of patches on rows of micro-images: where each begins.
#[derive(Debug)]
pub(super) struct HitList {
    pub(super) count: usize,
    /// Voxel in the segment.
    pub(super) voxels: [i32; ROOM],
    /// Offset in the table of patches.
    pub(super) shares: [i32; ROOM],
    /// Offset in the micro-images.
    pub(super) values: [i32; ROOM],
    /// The part of the way to the next phase across.
    pub(super) parts: [f32; ROOM],
    /// The columns of the micro-images where patches of more than 8 columns begin.
    pub(super) columns: [i32; ROOM],
}

/// A row of a patch on a row of a micro-image; see [`HitList`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    pub(super) voxel: usize,
    pub(super) shares: usize,
    pub(super) values: usize,
    pub(super) part: f32,
}

impl HitList {
    fn new() -> Self {
        Self {
            count: 0,
            voxels: [0; ROOM],
            shares: [0; ROOM],
            values: [0; ROOM],
            parts: [0.0; ROOM],
            columns: [0; ROOM],
        }
    }

    /// All hits.
    #[inline(always)]
    pub(super) fn iter(&self) -> impl Iterator<Item = Hit> + '_ {
        let all = self.voxels.iter().zip(&self.shares).zip(&self.values).zip(&self.parts).take(self.count);
        all.map(|(((voxel, shares), values), part)| Hit {
            voxel: *voxel as usize,
            shares: *shares as usize,
            values: *values as usize,
            part: *part,
        })
    }

    /// All hits, each with the column of the micro-image where its patch begins.
    #[inline(always)]
    pub(super) fn with_columns(&self) -> impl Iterator<Item = (Hit, i32)> + '_ {
        self.iter().zip(self.columns)
    }
}

/// End of the hits of one voxel under eight lenslets.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Group {
    pub(super) voxel: usize,
    /// End in all hits, and in those that the stop may cut.
    pub(super) end: usize,
    pub(super) end_cut: usize,
}

/// Hits of a segment's voxels under the lenslets of a row.
#[derive(Debug)]
pub(super) struct Hits {
    pub(super) all: HitList,
    /// The hits that the stop may cut, which are also among all.
    pub(super) cut: HitList,
    /// Groups of one voxel each, with at least one hit.
    groups: [Group; ROOM],
    group_count: usize,
    /// For each hit, the row of the table and approximately the share of its light that passes the stop.
    pub(super) lines: [i32; ROOM],
    pub(super) inside: [f32; ROOM],
}

impl Hits {
    pub(super) fn new() -> Self {
        let (all, cut) = (HitList::new(), HitList::new());
        let groups = [Group::default(); ROOM];
        Self { all, cut, groups, group_count: 0, lines: [0; ROOM], inside: [0.0; ROOM] }
    }

    /// Whether the hits should be used.
    #[inline(always)]
    pub(super) fn are_full(&self) -> bool {
        self.all.count > FULL
    }

    #[inline(always)]
    pub(super) fn clear(&mut self) {
        (self.all.count, self.cut.count, self.group_count) = (0, 0, 0);
    }

    /// The groups, one after the other.
    #[inline(always)]
    pub(super) fn groups(&self) -> &[Group] {
        &self.groups[..self.group_count]
    }

    /// For each hit, approximately the sum of its weights times the stop's area in pixels.
    #[inline(always)]
    pub(super) fn weights<'a>(&'a self, patches: &'a Patches) -> impl Iterator<Item = f32> + 'a {
        let all = self.lines.iter().zip(&self.inside).take(self.all.count);
        all.map(|(line, inside)| inside * patches.row_sums[*line as usize])
    }

    /// Ends the group of a voxel, if it has hits.
    #[inline(always)]
    pub(super) fn end_group(&mut self, voxel: usize) {
        let before = self.group_count.checked_sub(1).map_or(0, |last| self.groups[last].end);
        self.groups[self.group_count] = Group { voxel, end: self.all.count, end_cut: self.cut.count };
        self.group_count += usize::from(self.all.count > before);
    }
}
