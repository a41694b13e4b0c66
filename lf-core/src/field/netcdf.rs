//! A field from NetCDF in the classic format, of these tools or of another program.
//!
//! In: coordinates `x`, `y`, `z`, mm, equally spaced, and `u`, `v`, `w`, mm, over (z, y, x); `su`, `sv`, `sw`, `flag`,
//! `peak`, `ratio` and `count` may be absent. A vector that is NaN has no data. The attribute `lf_field`, if there is
//! one, holds the layout. Source: "NetCDF Classic Format Specification" of Unidata.

use super::vector_grid::{CHANNELS, VectorGrid};
use super::vectors::{Field, MEASURED, NO_DATA};
use crate::Refusal;
use std::collections::HashMap;

const WANTED: &str = "wanted NetCDF in the classic format, with x, y, z and u, v, w over (z, y, x), mm";
/// Largest difference of steps along an axis, relatively.
const UNEVEN: f64 = 1e-3;

/// Reads bytes from first to last.
struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn number(&mut self) -> Option<usize> {
        self.take(4).map(|bytes| u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize)
    }

    /// Bytes that are padded to four.
    fn padded(&mut self, count: usize) -> Option<&'a [u8]> {
        let padded = self.take(count.checked_next_multiple_of(4)?)?;
        Some(&padded[..count])
    }

    fn name(&mut self) -> Option<String> {
        let count = self.number()?;
        String::from_utf8(self.padded(count)?.to_vec()).ok()
    }

    /// The entries of a list with a tag.
    fn list<T>(&mut self, mut entry: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let (_tag, count) = (self.number()?, self.number()?);
        // An entry takes eight bytes or more.
        (count <= self.0.len() / 8).then_some(())?;
        (0..count).map(|_| entry(self)).collect()
    }

    /// Name, type and bytes of an attribute.
    fn attribute(&mut self) -> Option<(String, &'a [u8])> {
        let (name, kind) = (self.name()?, self.number()?);
        let count = self.number()?.checked_mul(width(kind)?)?;
        Some((name, self.padded(count)?))
    }
}

/// Bytes of a number of a type.
fn width(kind: usize) -> Option<usize> {
    [1, 1, 2, 4, 4, 8].get(kind.checked_sub(1)?).copied()
}

/// A number of a type.
fn value(kind: usize, bytes: &[u8]) -> f64 {
    match (kind, bytes) {
        (3, &[a, b]) => i16::from_be_bytes([a, b]).into(),
        (4, &[a, b, c, d]) => i32::from_be_bytes([a, b, c, d]).into(),
        (5, &[a, b, c, d]) => f32::from_be_bytes([a, b, c, d]).into(),
        (6, bytes) => bytes.try_into().map_or(f64::NAN, f64::from_be_bytes),
        (_, bytes) => f64::from(bytes[0] as i8),
    }
}

/// The variables without the record dimension: names of their dimensions, and values.
struct Content {
    variables: HashMap<String, (Vec<String>, Vec<f64>)>,
    layout: Option<String>,
}

fn content(bytes: &[u8]) -> Option<Content> {
    let mut cursor = Cursor(bytes);
    let version = cursor.take(4)?[3];
    ([1, 2].contains(&version)).then_some(())?;
    cursor.number()?;
    let dimensions = cursor.list(|cursor| Some((cursor.name()?, cursor.number()?)))?;
    let attributes = cursor.list(Cursor::attribute)?;
    let variables = cursor.list(|cursor| {
        let (name, count) = (cursor.name()?, cursor.number()?);
        let of: Option<Vec<&(String, usize)>> = (0..count).map(|_| dimensions.get(cursor.number()?)).collect();
        let of = of?;
        cursor.list(Cursor::attribute)?;
        let (kind, _size) = (cursor.number()?, cursor.number()?);
        let high = if version == 2 { cursor.number()? } else { 0 };
        let begin = (high << 32) | cursor.number()?;
        let len = of.iter().try_fold(1usize, |len, (_, n)| len.checked_mul(*n))?;
        let values = bytes.get(begin..begin.checked_add(len.checked_mul(width(kind)?)?)?)?;
        let values = values.chunks_exact(width(kind)?).map(|bytes| value(kind, bytes)).collect();
        Some((name, (of.iter().map(|(name, _)| name.clone()).collect(), values)))
    })?;
    let layout = attributes.into_iter().find(|(name, _)| name == "lf_field");
    let layout = layout.and_then(|(_, text)| String::from_utf8(text.to_vec()).ok());
    Some(Content { variables: variables.into_iter().collect(), layout })
}

/// Number, first place and step of equally spaced coordinates.
fn spaced(name: &str, places: &[f64]) -> Result<(usize, f64, f64), Refusal> {
    let step = if places.len() > 1 { places[1] - places[0] } else { 1.0 };
    let is_even = places.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() <= UNEVEN * step);
    Refusal::unless(!places.is_empty() && is_even, || format!("coordinates {name} with uneven steps"), WANTED)?;
    Ok((places.len(), places[0], step))
}

/// Reads a field.
pub(super) fn parse(bytes: &[u8]) -> Result<Field, Refusal> {
    let refused = |found: &str| Refusal::new(found, WANTED);
    Refusal::unless(bytes.starts_with(b"CDF"), || "NetCDF-4, which is HDF5", WANTED)?;
    let content = content(bytes).ok_or_else(|| refused("a NetCDF that is cut short or of another version"))?;
    let find = |name: &str| content.variables.get(name).ok_or_else(|| refused(&format!("a NetCDF without {name}")));
    let mut layout = VectorGrid::default();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        (layout.shape[axis], layout.origin_mm[axis], layout.spacing_mm[axis]) = spaced(name, &find(name)?.1)?;
    }
    if let Some(text) = &content.layout {
        let whole = VectorGrid::of_attribute("lf_field", text, WANTED)?;
        Refusal::unless(whole.shape == layout.shape, || "an attribute lf_field of another shape", WANTED)?;
        layout = whole;
    }
    layout.check()?;
    let mut field = Field::empty(layout);
    let len = field.len();
    let read = |name: &str| -> Result<Option<Vec<f32>>, Refusal> {
        let Some((dimensions, values)) = content.variables.get(name) else { return Ok(None) };
        let fits = dimensions.iter().eq(["z", "y", "x"]) && values.len() == len;
        Refusal::unless(fits, || format!("a NetCDF with {name} over ({})", dimensions.join(", ")), WANTED)?;
        Ok(Some(values.iter().map(|value| *value as f32).collect()))
    };
    for name in ["u", "v", "w"] {
        find(name)?;
    }
    field.flag.fill(MEASURED);
    let Field { u, v, w, peak, ratio, su, sv, sw, flag, count, .. } = &mut field;
    for ((name, ..), place) in CHANNELS.iter().zip([u, v, w, peak, ratio, su, sv, sw, flag, count]) {
        if let Some(values) = read(name)? {
            *place = values;
        }
    }
    for at in 0..len {
        if [field.u[at], field.v[at], field.w[at]].iter().any(|component| component.is_nan()) {
            (field.u[at], field.v[at], field.w[at], field.flag[at]) = (0.0, 0.0, 0.0, NO_DATA);
        }
    }
    field.check().map(|()| field)
}
