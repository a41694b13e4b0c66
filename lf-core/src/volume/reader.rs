//! Reads a `.lfv`: maps the file, checks it, and lends its columns.

use super::format::{Places, first_not_finite, first_not_rising};
use super::header::{VolumeHeader, header_text};
use crate::io::{self, Bytes};
use crate::{Error, Grid, History, Refusal, Result};
use serde_json::{Map, Value};
use std::{ops::Range, path::Path};

/// A `.lfv` that is read and checked.
pub struct Volume {
    bytes: Bytes,
    name: String,
    grid: Grid,
    history: History,
    extra: Map<String, Value>,
    /// Bytes of the indices.
    indices: Range<usize>,
    /// Name and bytes of each column.
    columns: Vec<(String, Range<usize>)>,
}

impl Volume {
    /// Opens and checks a file, or standard input for `-`.
    pub fn open(path: &Path) -> Result<Self> {
        Self::from_bytes(io::open(path)?, &io::name(path))
    }

    /// Checks bytes in memory; `name` stands for them in messages.
    pub fn from_bytes(bytes: Bytes, name: &str) -> Result<Self> {
        Self::parse(bytes, name).map_err(|refusal| refusal.about(name))
    }

    fn parse(bytes: Bytes, name: &str) -> std::result::Result<Self, Refusal> {
        let (text, header_end) = header_text(&bytes)?;
        let VolumeHeader { count, grid, columns, checksum, history, extra } = VolumeHeader::parse(text)?;
        let places = Places::new(header_end as u64, count, columns.len());
        check_length(places.end, bytes.len())?;
        // From here on every place lies inside the file, so it fits into a `usize`.
        let count = count as usize;
        let indices = header_end..header_end + 8 * count;
        let range = |i: usize| places.column(i) as usize..places.column(i) as usize + 4 * count;
        let columns = columns.into_iter().enumerate().map(|(i, column)| (column, range(i))).collect();
        check_sum(&bytes[header_end..], checksum)?;
        let volume = Self { bytes, name: name.to_owned(), grid, history, extra, indices, columns };
        volume.check_indices()?;
        volume.check_columns()?;
        Ok(volume)
    }

    fn check_indices(&self) -> std::result::Result<(), Refusal> {
        let indices = self.indices();
        if let Some(i) = first_not_rising(indices) {
            let found = format!("index {i} is {} after {}", indices[i], indices[i - 1]);
            return Err(Refusal::new(found, "wanted strictly rising indices"));
        }
        let (last, limit) = (indices.last().copied().unwrap_or(0), self.grid.len());
        let wanted = format!("wanted indices below {limit}, the voxels of its grid");
        Refusal::unless(last < limit, || format!("index {last} outside the grid"), wanted)
    }

    fn check_columns(&self) -> std::result::Result<(), Refusal> {
        let mut end = self.indices.end;
        for (i, (name, range)) in self.columns.iter().enumerate() {
            let is_zero = self.bytes[end..range.start].iter().all(|&byte| byte == 0);
            let found = || format!("bytes before column `{name}` are not zero");
            Refusal::unless(is_zero, found, "wanted zeros up to the column")?;
            end = range.end;
            let values = self.column_at(i);
            if let Some(at) = first_not_finite(values) {
                let found = format!("column `{name}` has {} at index {at}", values[at]);
                return Err(Refusal::new(found, "wanted finite values"));
            }
        }
        Ok(())
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The steps that led to this file.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Header keys beyond those of the format, in the order of the file.
    pub fn extra(&self) -> &Map<String, Value> {
        &self.extra
    }

    /// Name in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of voxels.
    pub fn count(&self) -> usize {
        self.indices.len() / 8
    }

    /// Strictly rising linear indices.
    pub fn indices(&self) -> &[u64] {
        bytemuck::cast_slice(&self.bytes[self.indices.clone()])
    }

    /// Names of the columns, in order.
    pub fn columns(&self) -> Vec<&str> {
        self.columns.iter().map(|(name, _)| name.as_str()).collect()
    }

    /// A column by name.
    pub fn column(&self, name: &str) -> Option<&[f32]> {
        self.columns.iter().position(|(known, _)| known == name).map(|i| self.column_at(i))
    }

    fn column_at(&self, i: usize) -> &[f32] {
        bytemuck::cast_slice(&self.bytes[self.columns[i].1.clone()])
    }

    /// A column that must be there; the error lists the columns of the file.
    pub fn require(&self, name: &str) -> Result<&[f32]> {
        self.column(name).ok_or_else(|| {
            let found = match self.columns().as_slice() {
                [] => "no columns".to_owned(),
                [one] => format!("only the column `{one}`"),
                many => format!("columns `{}`", many.join("`, `")),
            };
            Error::new(&self.name, found, format!("wanted a column `{name}`"))
        })
    }
}

fn check_length(wanted: u128, length: usize) -> std::result::Result<(), Refusal> {
    let how = if wanted > length as u128 { "cut short" } else { "too long" };
    let found = || format!("{how}, {length} bytes");
    Refusal::unless(wanted == length as u128, found, format!("wanted the {wanted} bytes that its header gives"))
}

fn check_sum(body: &[u8], wanted: u64) -> std::result::Result<(), Refusal> {
    let checksum = xxhash_rust::xxh3::xxh3_64(body);
    let found = || format!("damaged, its bytes give checksum {checksum:016x}");
    Refusal::unless(checksum == wanted, found, format!("wanted {wanted:016x} as its header says"))
}
