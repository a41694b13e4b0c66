//! The header of a `.lfv`, from and to text.

use super::format::{ALIGNMENT, KEYS, LONGEST_HEADER, PREFIX, SIGNATURE, VERSION};
use crate::{Refusal, frame, frame::MARK, grid::Grid, history::History};
use serde::Deserialize;
use serde_json::{Map, Value, json};

const WANTED: &str = "wanted the header of a .lfv file";

/// The text of the header and the place where it ends.
pub(super) fn header_text(bytes: &[u8]) -> Result<(&str, usize), Refusal> {
    let number = |at: usize| -> Option<u32> { Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?)) };
    let cut_short = || Refusal::new(format!("cut short, {} bytes", bytes.len()), "wanted a whole .lfv file");
    Refusal::unless(!bytes.is_empty(), || "empty", "wanted a .lfv file")?;
    let shared = bytes.iter().zip(&SIGNATURE).take_while(|(found, wanted)| found == wanted).count();
    if shared < SIGNATURE.len().min(bytes.len()) {
        let found = if shared >= 4 { "its signature was changed, as by a transfer as text" } else { "not a .lfv file" };
        return Err(Refusal::new(found, "wanted a .lfv file, made by lf-prune or lf-mart"));
    }
    let (Some(version), Some(length)) = (number(8), number(12)) else { return Err(cut_short()) };
    Refusal::unless(version == VERSION, || format!("version {version} of the format"), "wanted version 1")?;
    let length = length as usize;
    Refusal::unless(length <= LONGEST_HEADER, || format!("a header of {length} bytes"), "wanted at most 1 MiB")?;
    let end = PREFIX + length;
    let found = || format!("a header that ends at byte {end}");
    Refusal::unless(end.is_multiple_of(ALIGNMENT as usize), found, "wanted it padded to a multiple of 64")?;
    let text = std::str::from_utf8(bytes.get(PREFIX..end).ok_or_else(cut_short)?)
        .map_err(|error| Refusal::new(format!("byte {} of its header is not UTF-8", error.valid_up_to()), WANTED))?;
    Ok((text, end))
}

pub(super) struct VolumeHeader {
    pub count: u64,
    pub grid: Grid,
    pub columns: Vec<String>,
    pub checksum: u64,
    pub history: History,
    pub extra: Map<String, Value>,
}

fn take<T: for<'de> Deserialize<'de>>(map: &Map<String, Value>, key: &str) -> Result<T, Refusal> {
    let value = map.get(key).ok_or_else(|| wrong(format!("its header has no `{key}`")))?;
    T::deserialize(value).map_err(|error| wrong(format!("`{key}` in its header: {error}")))
}

fn wrong(found: impl Into<String>) -> Refusal {
    Refusal::new(found, WANTED)
}

impl VolumeHeader {
    pub fn parse(text: &str) -> Result<Self, Refusal> {
        // Only spaces may pad the header; JSON would allow other blanks.
        let text = text.trim_end_matches(' ');
        let is_object = text.starts_with('{') && text.ends_with('}');
        Refusal::unless(is_object, || "its header is not a JSON object", WANTED)?;
        let mut map: Map<String, Value> =
            serde_json::from_str(text).map_err(|error| wrong(format!("its header is not JSON: {error}")))?;
        frame::check(&map)?;
        let count: u64 = take(&map, "count")?;
        let grid: Grid = take(&map, "grid")?;
        grid.check().map_err(|refusal| Refusal { found: format!("its header: {}", refusal.found), ..refusal })?;
        let found = || format!("`count` in its header is {count}, more than the {} voxels of its grid", grid.len());
        Refusal::unless(count <= grid.len(), found, WANTED)?;
        let columns: Vec<String> = take(&map, "columns")?;
        check_names(&columns)?;
        let checksum: String = take(&map, "checksum")?;
        let checksum = Some(checksum)
            .filter(|digits| digits.len() == 16 && digits.bytes().all(|digit| digit.is_ascii_hexdigit()))
            .and_then(|digits| u64::from_str_radix(&digits, 16).ok())
            .ok_or_else(|| wrong("`checksum` in its header is not 16 hexadecimal digits"))?;
        let history = if map.contains_key("history") { take(&map, "history")? } else { History::new() };
        for key in KEYS {
            map.shift_remove(key);
        }
        Ok(Self { count, grid, columns, checksum, history, extra: map })
    }

    /// The header as it is written: JSON padded with spaces up to the alignment. A header is at most 1 MiB long.
    pub fn to_text(&self) -> Result<Vec<u8>, Refusal> {
        let Self { count, grid, columns, checksum, history, extra } = self;
        let checksum = format!("{checksum:016x}");
        let mut header = json!({"count": count, "frame": MARK, "grid": grid, "columns": columns, "checksum": checksum});
        if !history.is_empty() {
            header["history"] = json!(history);
        }
        for (key, value) in extra {
            header[key] = value.clone();
        }
        let mut text = header.to_string().into_bytes();
        text.resize((PREFIX + text.len()).next_multiple_of(ALIGNMENT as usize) - PREFIX, b' ');
        let found = || format!("its header would take {} bytes", text.len());
        Refusal::unless(text.len() <= LONGEST_HEADER, found, "wanted at most 1 MiB (LF_HISTORY=off shortens it)")?;
        Ok(text)
    }
}

fn check_names(columns: &[String]) -> Result<(), Refusal> {
    let mut names: Vec<&str> = columns.iter().map(String::as_str).collect();
    names.sort_unstable();
    let is_named = names.first().is_none_or(|name| !name.is_empty());
    Refusal::unless(is_named, || "`columns` in its header has an empty name", WANTED)?;
    let twin = names.windows(2).find(|pair| pair[0] == pair[1]);
    twin.map_or(Ok(()), |pair| Err(wrong(format!("`columns` in its header has `{}` twice", pair[0]))))
}
