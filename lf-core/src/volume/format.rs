//! The `.lfv` file of a sparse volume: its specification, and where its parts lie.
//!
//! A file holds one regular grid, the linear indices of some of its voxels, and any number of named columns with one
//! `f32` for each index. All numbers are little-endian. With `n` indices the file is, in this order and with no
//! other gaps than the zeros named here:
//!
//! | bytes | content |
//! | --- | --- |
//! | 8 | the signature `89 4C 46 56 0D 0A 1A 0A` |
//! | 4 | the version, a `u32`: 1 |
//! | 4 | `h`, the length of the header in bytes, a `u32`: at most 2^20, and 16 + h is a multiple of 64 |
//! | h | the header: one JSON object in UTF-8, padded with spaces to h bytes |
//! | 8 n | the indices, `u64`, strictly rising, the last below nx ny nz |
//! | 4 n | for each column: zeros up to a multiple of 64 bytes of the file, then the values, `f32`, all finite |
//!
//! The file ends with the last value of the last column, or with the last index if there are no columns. A file of any
//! other length is refused.
//!
//! Voxel (x, y, z) has the index `x + nx (y + ny z)`. The keys of the header are:
//!
//! - `count`: n, a whole number, at most nx ny nz.
//! - `frame`: `right-handed`, see [`mod@crate::frame`].
//! - `grid`: `{"shape": [nx, ny, nz], "spacing_mm": [dx, dy, dz], "origin_mm": [x, y, z]}` and nothing else. The origin
//!   is the centre of voxel (0, 0, 0) in the object frame of [`crate::optics`].
//! - `columns`: the names of the columns in the order of the file, all different, none empty.
//! - `checksum`: XXH3-64 (seed 0) of everything after the header, zeros included, as 16 hexadecimal digits.
//! - `history`: objects `{"tool", "version", "arguments"}`, oldest first; absent without history.
//! - `tile`: only in a file that holds a tile of a volume, see [`crate::volume::tile`].
//! - Other keys are kept for programs that know them: [`crate::volume::Volume::extra`], [`crate::volume::write_with`].
//!
//! A reader that returns `Ok` has checked every sentence above, has allocated no more than the text of the header
//! needs, and lends slices of the file itself. The checksum does not cover the header.

#[cfg(target_endian = "big")]
compile_error!("columns are lent from the file as they are, and the file is little-endian");

/// First bytes of every `.lfv`. A byte above 127 and both kinds of line ends reveal a transfer as text.
pub const SIGNATURE: [u8; 8] = *b"\x89LFV\r\n\x1a\n";

pub(super) const VERSION: u32 = 1;
/// Bytes of signature, version and header length.
pub(super) const PREFIX: usize = 16;
/// Largest header, bytes. A thousand steps of history fit many times; a longer header is damage.
pub(super) const LONGEST_HEADER: usize = 1 << 20;
/// The header ends and columns start at multiples of this, bytes: a cache line and a 512-bit register.
pub(super) const ALIGNMENT: u64 = 64;
/// Header keys of the format itself.
pub(super) const KEYS: [&str; 6] = ["count", crate::frame::KEY, "grid", "columns", "checksum", "history"];

/// Places of the parts of a file, bytes. No header can overflow a `u128`.
pub(super) struct Places {
    indices_end: u128,
    column: u128,
    /// Length of the file.
    pub end: u128,
}

impl Places {
    /// `start`, the place of the indices, is a multiple of the alignment.
    pub fn new(start: u64, count: u64, columns: usize) -> Self {
        let indices_end = u128::from(start) + 8 * u128::from(count);
        let mut places = Self { indices_end, column: 4 * u128::from(count), end: indices_end };
        if let Some(last) = columns.checked_sub(1) {
            places.end = places.column(last) + places.column;
        }
        places
    }

    /// Start of column `i`. All columns are equally long.
    pub fn column(&self, i: usize) -> u128 {
        let alignment = u128::from(ALIGNMENT);
        self.indices_end.next_multiple_of(alignment) + i as u128 * self.column.next_multiple_of(alignment)
    }

    /// Number of zeros before column `i`.
    pub fn gap(&self, i: usize) -> usize {
        let before = if i == 0 { self.indices_end } else { self.column };
        (before.next_multiple_of(u128::from(ALIGNMENT)) - before) as usize
    }
}

/// Values checked between two looks at the outcome, so that the checks run without branches.
const BLOCK: usize = 4096;

/// Position of the first index that is not above the one before; None if all rise.
pub(super) fn first_not_rising(indices: &[u64]) -> Option<usize> {
    let rises = |pair: &[u64]| pair[0] < pair[1];
    for start in (0..indices.len()).step_by(BLOCK) {
        let block = &indices[start..(start + BLOCK + 1).min(indices.len())];
        if !block.windows(2).fold(true, |all, pair| all & rises(pair)) {
            return block.windows(2).position(|pair| !rises(pair)).map(|at| start + at + 1);
        }
    }
    None
}

/// Position of the first value that is not finite; None if all are.
pub(super) fn first_not_finite(values: &[f32]) -> Option<usize> {
    for (i, block) in values.chunks(BLOCK).enumerate() {
        if !block.iter().fold(true, |all, value| all & value.is_finite()) {
            return block.iter().position(|value| !value.is_finite()).map(|at| i * BLOCK + at);
        }
    }
    None
}
