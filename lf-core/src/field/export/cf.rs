//! A field, or a series of fields, as NetCDF after the CF conventions (version 1.8).
//!
//! Dimensions are (t,) z, y, x; their coordinates have the same names, mm and s. The variables are the channels of the
//! EXR under the same names. Vectors without data are NaN. The attribute `history` has a line for each step; the
//! attribute `lf_field` holds the JSON of the EXR's attribute, so that nothing is lost.

use super::netcdf::{Attributes, NetcdfHeader, NumberType, Value, Variable, write_bytes, write_doubles, write_floats};
use super::{parts, vti::Array};
use crate::field::{vector_grid::CHANNELS, vector_grid::VectorGrid, vectors::Field, vectors::NO_DATA};
use crate::{Refusal, Result, frame::MARK, history, io};
use std::io::{Error, Write};
use std::path::Path;

/// The times of a series.
#[derive(Debug, Clone, PartialEq)]
pub enum Time {
    /// Seconds, one a field.
    Seconds(Vec<f64>),
    /// The times are not known: fields are numbered from 0.
    Numbers(usize),
}

impl Time {
    /// Number of fields.
    pub fn count(&self) -> usize {
        match self {
            Self::Seconds(seconds) => seconds.len(),
            Self::Numbers(count) => *count,
        }
    }

    /// The time of field `n`.
    fn at(&self, n: usize) -> f64 {
        match self {
            Self::Seconds(seconds) => seconds[n],
            Self::Numbers(_) => n as f64,
        }
    }

    fn attributes(&self) -> Attributes {
        let (name, unit) = match self {
            Self::Seconds(_) => ("time of the field", "s"),
            Self::Numbers(_) => ("number of the field", "1"),
        };
        vec![("long_name", name.into()), ("units", unit.into()), ("axis", "T".into())]
    }
}

/// Number of the channel `flag`.
const FLAG: usize = 8;
/// Variables that qualify u, v and w.
const ANCILLARY: [&str; 3] = ["su flag peak ratio count", "sv flag peak ratio count", "sw flag peak ratio count"];

/// Writes one field, without the dimension t.
pub(in crate::field) fn write_cf(field: &Field, more: &[Array], out: &mut dyn Write) -> std::io::Result<()> {
    let (mut header, more) = (header(&field.layout, None), parts::all(more));
    let dimensions = header.dimensions.len();
    header.variables.extend(more.iter().map(|(name, _)| additional(name, dimensions)));
    out.write_all(&header.bytes().map_err(Error::other)?)?;
    write_places(&field.layout, out)?;
    write_components(field, out)?;
    more.iter().try_for_each(|(_, values)| write_floats(out, values.iter().copied()))
}

/// Writes a series of fields as one NetCDF with the dimension t. `next` gives field `n`; one is in memory at a time.
/// Refuses a field whose vectors have other places or another time between their volumes than the first.
pub fn save_series(path: &Path, time: &Time, mut next: impl FnMut(usize) -> Result<Field>) -> Result<()> {
    let mut first = Some(next(0)?);
    let layout = first.as_ref().map(|field| field.layout.clone()).unwrap_or_default();
    let bytes = header(&layout, Some(time)).bytes();
    let bytes = bytes.map_err(|refusal| refusal.about(io::output_name(path)))?;
    io::save(path, |out| {
        out.write_all(&bytes)?;
        write_places(&layout, out)?;
        for n in 0..time.count() {
            let field = first.take().map_or_else(|| next(n), Ok).map_err(Error::other)?;
            check_alike(&layout, &field.layout, n).map_err(Error::other)?;
            write_doubles(out, [time.at(n)].into_iter())?;
            write_components(&field, out)?;
        }
        Ok(())
    })
}

/// Refuses field `n` of a series if its layout is not that of the first.
fn check_alike(first: &VectorGrid, other: &VectorGrid, n: usize) -> std::result::Result<(), Refusal> {
    let field = format!("field {} of the series has", n + 1);
    let is_alike =
        other.shape == first.shape && other.origin_mm == first.origin_mm && other.spacing_mm == first.spacing_mm;
    let found = || format!("{field} its vectors at other places");
    Refusal::unless(is_alike, found, "wanted the places of the first")?;
    let time = |layout: &VectorGrid| layout.dt_s.map_or_else(|| "no time".to_owned(), |dt_s| format!("{dt_s} s"));
    let found = || format!("{field} {} between its volumes", time(other));
    Refusal::unless(other.dt_s == first.dt_s, found, format!("wanted {} like the first", time(first)))
}

fn write_places(layout: &VectorGrid, out: &mut dyn Write) -> std::io::Result<()> {
    for axis in [0, 1, 2] {
        let place = |n: usize| layout.origin_mm[axis] + n as f64 * layout.spacing_mm[axis];
        write_doubles(out, (0..layout.shape[axis]).map(place))?;
    }
    Ok(())
}

fn write_components(field: &Field, out: &mut dyn Write) -> std::io::Result<()> {
    for (n, values) in field.components().into_iter().enumerate() {
        match n {
            0..3 => {
                let known = |(value, flag): (&f32, &f32)| if *flag == NO_DATA { f32::NAN } else { *value };
                write_floats(out, values.iter().zip(&field.flag).map(known))?;
            }
            FLAG => write_bytes(out, values.iter().map(|flag| *flag as i8))?,
            _ => write_floats(out, values.iter().copied())?,
        }
    }
    Ok(())
}

fn header(layout: &VectorGrid, time: Option<&Time>) -> NetcdfHeader {
    let [nx, ny, nz] = layout.shape;
    let records = time.map(|time| ("t", time.count()));
    let dimensions: Vec<_> = records.into_iter().chain([("z", nz), ("y", ny), ("x", nx)]).collect();
    let place = |name: &'static str, dimension: usize, axis: &str, meaning: &str| Variable {
        name: name.to_owned(),
        dimensions: vec![dimension],
        kind: NumberType::Double,
        attributes: vec![("long_name", meaning.into()), ("units", "mm".into()), ("axis", axis.into())],
    };
    let last = dimensions.len() - 1;
    let mut variables = vec![
        place("x", last, "X", "to the right in the picture"),
        place("y", last - 1, "Y", "upwards in the picture"),
        place("z", last - 2, "Z", "towards the camera, 0 in the focal plane"),
    ];
    if let Some(time) = time {
        variables.push(Variable {
            name: "t".to_owned(),
            dimensions: vec![0],
            kind: NumberType::Double,
            attributes: time.attributes(),
        });
    }
    variables.extend((0..CHANNELS.len()).map(|n| component(n, dimensions.len())));
    NetcdfHeader { dimensions, has_records: time.is_some(), attributes: about(layout), variables }
}

/// The variable of a component.
fn component(n: usize, dimensions: usize) -> Variable {
    let (name, unit, meaning) = CHANNELS[n];
    let mut attributes: Attributes = vec![("long_name", meaning.into())];
    if n == FLAG {
        attributes.push(("flag_values", Value::Bytes(vec![0, 1, 2])));
        attributes.push(("flag_meanings", "measured replaced no_data".into()));
    } else {
        attributes.push(("units", unit.into()));
        attributes.push(("_FillValue", Value::Floats(vec![f32::NAN])));
    }
    if let Some(others) = ANCILLARY.get(n) {
        attributes.push(("ancillary_variables", (*others).into()));
    }
    let kind = if n == FLAG { NumberType::Byte } else { NumberType::Float };
    Variable { name: name.to_owned(), dimensions: (0..dimensions).collect(), kind, attributes }
}

/// The variable of additional numbers at every vector. Its name ends with its unit.
fn additional(name: &str, dimensions: usize) -> Variable {
    let attributes = vec![("long_name", Value::Text(name.to_owned())), ("_FillValue", Value::Floats(vec![f32::NAN]))];
    Variable { name: name.to_owned(), dimensions: (0..dimensions).collect(), kind: NumberType::Float, attributes }
}

/// The attributes of the whole file.
fn about(layout: &VectorGrid) -> Attributes {
    let source = layout.history.last().map(|step| format!("{} {}", step.tool, step.version));
    let frame = format!("frame: {MARK}; x right and y up in the picture, z towards the camera");
    let mut about: Attributes = vec![
        ("Conventions", "CF-1.8".into()),
        ("title", "displacement of a flow by light-field particle image velocimetry".into()),
        ("source", Value::Text(source.unwrap_or_else(|| "lf".to_owned()))),
        ("comment", Value::Text(frame)),
        ("history", Value::Text(history::lines(&layout.history).join("\n"))),
    ];
    if let Some(dt_s) = layout.dt_s {
        about.push(("dt_s", Value::Doubles(vec![dt_s])));
    }
    about.push(("lf_field", Value::Text(layout.to_json())));
    about
}
