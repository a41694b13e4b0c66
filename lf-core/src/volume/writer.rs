//! Writes a `.lfv` in one pass.

use super::format::{ALIGNMENT, KEYS, Places, SIGNATURE, VERSION, first_not_finite, first_not_rising};
use super::header::VolumeHeader;
use crate::{Refusal, grid::Grid, history::History};
use serde_json::{Map, Value};
use std::io::Write;
use xxhash_rust::xxh3::Xxh3;

/// Writes a `.lfv` in one pass, without seeking. An empty history is left out. Refuses values that are not finite, and
/// a header above 1 MiB. Panics if the grid is invalid, indices do not rise or lie outside the grid, or a column has
/// the wrong length, no name, or the name of another.
pub fn write(
    out: &mut dyn Write,
    grid: &Grid,
    indices: &[u64],
    columns: &[(&str, &[f32])],
    history: &History,
) -> std::io::Result<()> {
    write_with(out, grid, indices, columns, history, &Map::new())
}

/// Writes like [`write()`], with header keys beyond the format's own, such as [`extra`](super::Volume::extra).
pub fn write_with(
    out: &mut dyn Write,
    grid: &Grid,
    indices: &[u64],
    columns: &[(&str, &[f32])],
    history: &History,
    extra: &Map<String, Value>,
) -> std::io::Result<()> {
    check(grid, indices, columns)?;
    assert!(KEYS.iter().all(|&key| !extra.contains_key(key)), "an extra key of the format's own name");

    let mut checksum = Xxh3::new();
    body(indices, columns).for_each(|bytes| checksum.update(bytes));
    let header = VolumeHeader {
        count: indices.len() as u64,
        grid: grid.clone(),
        columns: columns.iter().map(|(name, _)| (*name).to_owned()).collect(),
        checksum: checksum.digest(),
        history: history.clone(),
        extra: extra.clone(),
    };
    let text = header.to_text().map_err(invalid)?;

    out.write_all(&SIGNATURE)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&(text.len() as u32).to_le_bytes())?;
    out.write_all(&text)?;
    body(indices, columns).try_for_each(|bytes| out.write_all(bytes))
}

fn check(grid: &Grid, indices: &[u64], columns: &[(&str, &[f32])]) -> std::io::Result<()> {
    grid.check().unwrap_or_else(|refusal| panic!("{refusal}"));
    assert!(first_not_rising(indices).is_none(), "indices do not rise");
    assert!(indices.last().is_none_or(|&last| last < grid.len()), "an index outside the grid");
    for (i, (name, values)) in columns.iter().enumerate() {
        assert!(!name.is_empty() && columns[..i].iter().all(|(other, _)| other != name), "column name {name:?}");
        assert_eq!(values.len(), indices.len(), "length of column {name}");
        if let Some(at) = first_not_finite(values) {
            let found = format!("column `{name}` would hold {} at index {at}", values[at]);
            return Err(invalid(Refusal::new(found, "wanted finite values")));
        }
    }
    Ok(())
}

/// Everything after the header.
fn body<'a>(indices: &'a [u64], columns: &'a [(&str, &[f32])]) -> impl Iterator<Item = &'a [u8]> {
    // The header ends at a multiple of the alignment, so gaps can be found without its length.
    let places = Places::new(0, indices.len() as u64, columns.len());
    let column = move |(i, (_, values)): (usize, &(&str, &'a [f32]))| {
        [&[0; ALIGNMENT as usize][..places.gap(i)], bytemuck::cast_slice(values)]
    };
    std::iter::once(bytemuck::cast_slice(indices)).chain(columns.iter().enumerate().flat_map(column))
}

fn invalid(refusal: Refusal) -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::InvalidData, refusal)
}
