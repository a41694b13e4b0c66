//! The `.lfv` sparse voxel file: its specification, a reader that maps it, a writer that streams it.
//!
//! One regular grid, the linear indices of some of its voxels, and any number of named columns that hold one `f32` for
//! each index. Every number is little-endian. With `n` indices the file is, in this order and with nothing between:
//!
//! | bytes | content |
//! | --- | --- |
//! | 8 | the signature `89 4C 46 56 0D 0A 1A 0A` |
//! | 4 | the version, a `u32`: 1 |
//! | 4 | `h`, the length of the header in bytes, a `u32`: at most 2^20, and such that 16 + h is a multiple of 64 |
//! | h | the header: one JSON object in UTF-8, then as many spaces as bring it to h bytes |
//! | 8 n | the indices, `u64`, each greater than the one before, the last below nx ny nz |
//! | 4 n | a column, `f32`, all finite, begun at a multiple of 64 from the start of the file after bytes of zero; once for each name in the header |
//!
//! The last column's last value is the end of the file (without columns, the last index is): any other length is refused.
//!
//! Voxel (x, y, z) has the index `x + nx (y + ny z)`. The header's keys:
//!
//! - `count`: n, a whole number, at most nx ny nz.
//! - `grid`: `{"shape": [nx, ny, nz], "spacing_mm": [dx, dy, dz], "origin_mm": [x, y, z]}` and nothing else; the origin is
//!   the centre of voxel (0, 0, 0) in the object frame of [`crate::optics`].
//! - `columns`: names, all different, none empty, in the order in which the columns follow.
//! - `checksum`: XXH3-64 (seed 0) of everything behind the header, gaps included, as 16 hexadecimal digits.
//! - `history`: objects `{"tool", "version", "arguments"}`, oldest first; absent means none.
//! - `tile`: present where the file is a part of a volume only, see [`crate::volume::tile`].
//! - any other key is kept for whoever knows it: [`Volume::extra`], [`write_with`].
//!
//! Promise: a reader that returns `Ok` has checked every sentence above, has allocated no more than the header's own text
//! asks for, and gives slices of the file itself. The header is not under the checksum.

use crate::grid::Grid;
use crate::history::History;
use crate::io::{self, Bytes};
use crate::{Error, Result};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::ops::Range;
use std::path::Path;
use xxhash_rust::xxh3::Xxh3;

#[cfg(target_endian = "big")]
compile_error!("columns are lent from the file as they are, and the file is little-endian");

/// The first bytes of every `.lfv`: one above 127 and line ends of both kinds, so that a transfer as text shows.
pub const SIGNATURE: [u8; 8] = *b"\x89LFV\r\n\x1a\n";

const VERSION: u32 = 1;

/// Signature, version and header length.
const PREFIX: usize = 16;

/// A longer header is damage: a thousand steps of history fit many times.
const LONGEST_HEADER: usize = 1 << 20;

/// Columns start at a multiple of this, a cache line and a 512-bit register.
const ALIGNMENT: u64 = 64;

/// Values checked between two looks at the outcome, so that the checks run without branches.
const BLOCK: usize = 4096;

/// Header keys that are not extra.
const KEYS: [&str; 5] = ["count", "grid", "columns", "checksum", "history"];

/// A `.lfv` read and checked.
pub struct Volume {
    bytes: Bytes,
    name: String,
    grid: Grid,
    history: History,
    extra: Map<String, Value>,
    indices: Range<usize>,
    columns: Vec<(String, Range<usize>)>,
}

impl Volume {
    /// Opens and checks a file, or standard input for `-`.
    pub fn open(path: &Path) -> Result<Self> {
        Self::from_bytes(io::open(path)?, &io::name(path))
    }

    /// Checks bytes already in memory; `name` is what messages call them.
    pub fn from_bytes(bytes: Bytes, name: &str) -> Result<Self> {
        let fail = |found: String, wanted: &str| Error::new(name, found, wanted);
        let (text, header_end) = header_text(&bytes).map_err(|(found, wanted)| fail(found, wanted))?;
        let header = Header::parse(text).map_err(|found| fail(found, "wanted the header of a .lfv file"))?;

        let places = Places::new(header_end as u64, header.count, header.columns.len());
        let length = bytes.len();
        if places.end != length as u128 {
            let how = if places.end > length as u128 { "cut short" } else { "too long" };
            let wanted = format!("wanted the {} bytes that its header gives", places.end);
            return Err(Error::new(name, format!("{how}, {length} bytes"), wanted));
        }
        // From here on every place lies inside the file, so it fits in memory's own numbers.
        let count = header.count as usize;
        let indices = header_end..header_end + 8 * count;
        let columns: Vec<_> = header
            .columns
            .into_iter()
            .enumerate()
            .map(|(i, column)| (column, places.column(i) as usize..places.column(i) as usize + 4 * count))
            .collect();

        let checksum = xxhash_rust::xxh3::xxh3_64(&bytes[header_end..]);
        if checksum != header.checksum {
            let found = format!("damaged, its bytes give checksum {checksum:016x}");
            return Err(Error::new(name, found, format!("wanted {:016x} as its header says", header.checksum)));
        }
        let mut end = indices.end;
        for (column, range) in &columns {
            if bytes[end..range.start].iter().any(|&byte| byte != 0) {
                return Err(fail(
                    format!("bytes before column `{column}` are not zero"),
                    "wanted zeros up to the column",
                ));
            }
            end = range.end;
        }
        let volume = Self {
            bytes,
            name: name.to_owned(),
            grid: header.grid,
            history: header.history,
            extra: header.extra,
            indices,
            columns,
        };
        if let Some(i) = first_not_rising(volume.indices()) {
            let indices = volume.indices();
            let found = format!("index {i} is {} after {}", indices[i], indices[i - 1]);
            return Err(fail(found, "wanted strictly rising indices"));
        }
        if let Some(&last) = volume.indices().last().filter(|&&last| last >= volume.grid.len()) {
            let wanted = format!("wanted indices below {}, the voxels of its grid", volume.grid.len());
            return Err(Error::new(name, format!("index {last} outside the grid"), wanted));
        }
        for i in 0..volume.columns.len() {
            if let Some(at) = first_not_finite(volume.column_at(i)) {
                let found = format!("column `{}` has {} at index {at}", volume.columns[i].0, volume.column_at(i)[at]);
                return Err(fail(found, "wanted finite values"));
            }
        }
        Ok(volume)
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The steps that led to this file.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Header keys that this version does not know, in the file's order.
    pub fn extra(&self) -> &Map<String, Value> {
        &self.extra
    }

    /// What messages call this file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of voxels in the file.
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

    /// A column by name, or an error naming this file, the columns it has and the one wanted.
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

/// Writes a `.lfv` in one pass, without seeking. Panics if indices do not rise or lengths differ.
///
/// # Errors
/// Those of `out`, and a value that is not finite.
///
/// # Panics
/// Also where an index lies outside the grid, the grid is not one, or two columns share a name.
pub fn write(
    out: &mut dyn Write,
    grid: &Grid,
    indices: &[u64],
    columns: &[(&str, &[f32])],
    history: &History,
) -> std::io::Result<()> {
    write_with(out, grid, indices, columns, history, &Map::new())
}

/// Writes as [`write()`] does, with further header keys, such as another file's [`Volume::extra`]. An empty history is left out.
///
/// # Errors
/// Those of `out`, a value that is not finite, and a header above 1 MiB.
///
/// # Panics
/// As [`write()`], and where a key is one of the format's own.
pub fn write_with(
    out: &mut dyn Write,
    grid: &Grid,
    indices: &[u64],
    columns: &[(&str, &[f32])],
    history: &History,
    extra: &Map<String, Value>,
) -> std::io::Result<()> {
    if let Err(refusal) = grid.check() {
        panic!("{refusal}");
    }
    assert!(first_not_rising(indices).is_none(), "indices do not rise");
    assert!(indices.last().is_none_or(|&last| last < grid.len()), "an index outside the grid");
    for (i, (name, values)) in columns.iter().enumerate() {
        assert!(!name.is_empty() && columns[..i].iter().all(|(other, _)| other != name), "column name {name:?}");
        assert_eq!(values.len(), indices.len(), "length of column {name}");
        if let Some(at) = first_not_finite(values) {
            return Err(refuse(format!("column `{name}` would hold {} at index {at}", values[at]), "finite values"));
        }
    }
    assert!(KEYS.iter().all(|&key| !extra.contains_key(key)), "an extra key of the format's own name");

    // Gaps depend on places modulo the alignment only, and the header ends at a multiple of it.
    let places = Places::new(0, indices.len() as u64, columns.len());
    let gap = places.gap();
    let zeros = [0u8; ALIGNMENT as usize];
    let mut sum = Xxh3::new();
    sum.update(bytemuck::cast_slice(indices));
    let mut before = places.first_gap();
    for (_, values) in columns {
        sum.update(&zeros[..before]);
        sum.update(bytemuck::cast_slice(values));
        before = gap;
    }

    let mut header = Map::new();
    header.insert("count".into(), json!(indices.len()));
    header.insert("grid".into(), json!(grid));
    header.insert("columns".into(), columns.iter().map(|(name, _)| *name).collect());
    header.insert("checksum".into(), json!(format!("{:016x}", sum.digest())));
    if !history.is_empty() {
        header.insert("history".into(), json!(history));
    }
    header.extend(extra.iter().map(|(key, value)| (key.clone(), value.clone())));
    let mut text = Value::Object(header).to_string().into_bytes();
    text.resize((PREFIX + text.len()).next_multiple_of(ALIGNMENT as usize) - PREFIX, b' ');
    if text.len() > LONGEST_HEADER {
        return Err(refuse(format!("its header would take {} bytes", text.len()), "at most 1 MiB (LF_HISTORY=off)"));
    }

    out.write_all(&SIGNATURE)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&(text.len() as u32).to_le_bytes())?;
    out.write_all(&text)?;
    out.write_all(bytemuck::cast_slice(indices))?;
    let mut before = places.first_gap();
    for (_, values) in columns {
        out.write_all(&zeros[..before])?;
        out.write_all(bytemuck::cast_slice(values))?;
        before = gap;
    }
    Ok(())
}

fn refuse(found: String, wanted: &str) -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::InvalidData, format!("{found}, a .lfv holds {wanted}"))
}

/// Where the parts of a file lie; wide enough that no header can overflow it.
struct Places {
    indices_end: u128,
    column: u128,
    end: u128,
}

impl Places {
    /// `start` is a multiple of the alignment.
    fn new(start: u64, count: u64, columns: usize) -> Self {
        let indices_end = u128::from(start) + 8 * u128::from(count);
        let mut places = Self { indices_end, column: 4 * u128::from(count), end: indices_end };
        if let Some(last) = columns.checked_sub(1) {
            places.end = places.column(last) + places.column;
        }
        places
    }

    /// Start of column `i`. All columns have one length, so they start at equal distances.
    fn column(&self, i: usize) -> u128 {
        let alignment = u128::from(ALIGNMENT);
        self.indices_end.next_multiple_of(alignment) + i as u128 * self.column.next_multiple_of(alignment)
    }

    /// Zeros between the indices and the first column.
    fn first_gap(&self) -> usize {
        (self.indices_end.next_multiple_of(u128::from(ALIGNMENT)) - self.indices_end) as usize
    }

    /// Zeros between one column and the next.
    fn gap(&self) -> usize {
        (self.column.next_multiple_of(u128::from(ALIGNMENT)) - self.column) as usize
    }
}

/// The header's text and where it ends, or what was found and what was wanted.
fn header_text(bytes: &[u8]) -> std::result::Result<(&str, usize), (String, &'static str)> {
    let number = |at: usize| -> Option<u32> { Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?)) };
    let shared = bytes.iter().zip(&SIGNATURE).take_while(|(found, wanted)| found == wanted).count();
    if bytes.is_empty() {
        return Err(("empty".into(), "wanted a .lfv file"));
    }
    if shared < SIGNATURE.len().min(bytes.len()) {
        let found = if shared >= 4 { "its signature was changed, as by a transfer as text" } else { "not a .lfv file" };
        return Err((found.into(), "wanted a .lfv file, made by lf-prune or lf-mart"));
    }
    let (Some(version), Some(length)) = (number(8), number(12)) else {
        return Err((format!("cut short, {} bytes", bytes.len()), "wanted a whole .lfv file"));
    };
    if version != VERSION {
        return Err((format!("version {version} of the format"), "wanted version 1"));
    }
    let length = length as usize;
    if length > LONGEST_HEADER {
        return Err((format!("a header of {length} bytes"), "wanted at most 1 MiB"));
    }
    let end = PREFIX + length;
    if !end.is_multiple_of(ALIGNMENT as usize) {
        return Err((format!("a header that ends at byte {end}"), "wanted it padded to a multiple of 64"));
    }
    let Some(text) = bytes.get(PREFIX..end) else {
        return Err((format!("cut short, {} bytes", bytes.len()), "wanted a whole .lfv file"));
    };
    match std::str::from_utf8(text) {
        Ok(text) => Ok((text, end)),
        Err(error) => Err((
            format!("byte {} of its header is not UTF-8", error.valid_up_to()),
            "wanted the header of a .lfv file",
        )),
    }
}

struct Header {
    count: u64,
    grid: Grid,
    columns: Vec<String>,
    checksum: u64,
    history: History,
    extra: Map<String, Value>,
}

impl Header {
    /// # Errors
    /// Says what is wrong with which key.
    fn parse(text: &str) -> std::result::Result<Self, String> {
        fn take<T: for<'de> Deserialize<'de>>(map: &Map<String, Value>, key: &str) -> std::result::Result<T, String> {
            let value = map.get(key).ok_or_else(|| format!("its header has no `{key}`"))?;
            T::deserialize(value).map_err(|error| format!("`{key}` in its header: {error}"))
        }
        // Spaces alone may pad; JSON would allow other blanks.
        let text = text.trim_end_matches(' ');
        if !(text.starts_with('{') && text.ends_with('}')) {
            return Err("its header is not a JSON object".into());
        }
        let mut map: Map<String, Value> =
            serde_json::from_str(text).map_err(|error| format!("its header is not JSON: {error}"))?;
        let count: u64 = take(&map, "count")?;
        let grid: Grid = take(&map, "grid")?;
        grid.check().map_err(|refusal| format!("its header: {}", refusal.found))?;
        if count > grid.len() {
            return Err(format!("`count` in its header is {count}, more than the {} voxels of its grid", grid.len()));
        }
        let columns: Vec<String> = take(&map, "columns")?;
        let mut names: Vec<&str> = columns.iter().map(String::as_str).collect();
        names.sort_unstable();
        if names.first().is_some_and(|name| name.is_empty()) {
            return Err("`columns` in its header has an empty name".into());
        }
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(format!("`columns` in its header has `{}` twice", pair[0]));
        }
        let checksum: String = take(&map, "checksum")?;
        if checksum.len() != 16 || !checksum.bytes().all(|digit| digit.is_ascii_hexdigit()) {
            return Err("`checksum` in its header is not 16 hexadecimal digits".into());
        }
        let checksum = u64::from_str_radix(&checksum, 16).map_err(|error| error.to_string())?;
        let history = if map.contains_key("history") { take(&map, "history")? } else { History::new() };
        for key in KEYS {
            map.shift_remove(key);
        }
        Ok(Self { count, grid, columns, checksum, history, extra: map })
    }
}

/// Place of the first index that is not above the one before.
fn first_not_rising(indices: &[u64]) -> Option<usize> {
    let rises = |pair: &[u64]| pair[0] < pair[1];
    for start in (0..indices.len()).step_by(BLOCK) {
        let block = &indices[start..(start + BLOCK + 1).min(indices.len())];
        if !block.windows(2).fold(true, |all, pair| all & rises(pair)) {
            return block.windows(2).position(|pair| !rises(pair)).map(|at| start + at + 1);
        }
    }
    None
}

fn first_not_finite(values: &[f32]) -> Option<usize> {
    for (i, block) in values.chunks(BLOCK).enumerate() {
        if !block.iter().fold(true, |all, value| all & value.is_finite()) {
            return block.iter().position(|value| !value.is_finite()).map(|at| i * BLOCK + at);
        }
    }
    None
}
