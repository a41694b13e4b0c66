//! A field from and to a file.

use super::export::{Array, write_cf, write_csv, write_vti};
use super::netcdf;
use super::vector_grid::{CHANNELS, COUNT, VectorGrid};
use super::vectors::Field;
use crate::image::{exr, guarded};
use crate::io::{self, Signature};
use crate::{Refusal, Result, frame};
use serde::Deserialize;
use serde_json::{Map, Value};
use std::path::Path;

/// The attribute that holds the layout.
const LAYOUT: &str = "lf:field";

/// The formats of a field.
enum Form {
    Exr,
    Vti,
    NetCdf,
    Csv,
}

impl Form {
    /// The format that a name asks for by its extension; `-` and a name without one are EXR.
    fn of(path: &Path) -> Result<Self> {
        match path.extension().map(|extension| extension.to_string_lossy().to_lowercase()).as_deref() {
            None | Some("exr") => Ok(Self::Exr),
            Some("vti") => Ok(Self::Vti),
            Some("nc") => Ok(Self::NetCdf),
            Some("csv") => Ok(Self::Csv),
            Some(other) => {
                let wanted = "wanted .exr, .vti, .nc or .csv";
                Err(Refusal::new(format!("the extension .{other}"), wanted).about(io::output_name(path)))
            }
        }
    }
}

impl VectorGrid {
    /// Reads the attribute with this name of a file that `wanted` describes.
    pub(super) fn of_attribute(name: &str, text: &str, wanted: &'static str) -> std::result::Result<Self, Refusal> {
        let wrong = |error: serde_json::Error| Refusal::new(format!("attribute {name}: {error}"), wanted);
        let attribute: Map<String, Value> = serde_json::from_str(text).map_err(wrong)?;
        frame::check(&attribute)?;
        let layout = Self::deserialize(Value::from(attribute)).map_err(wrong)?;
        layout.check()?;
        Ok(layout)
    }

    /// Reads the layout of a field, of an EXR without its vectors.
    pub fn open(path: &Path) -> Result<Self> {
        let bytes = io::open(path)?;
        let layout = || match Signature::of(&bytes) {
            Some(Signature::NetCdf) => netcdf::parse(&bytes).map(|field| field.layout),
            _ => head(&bytes).map(|(_, layout)| layout),
        };
        guarded(layout).map_err(|refusal| refusal.about(io::name(path)))
    }
}

impl Field {
    /// Reads a field, EXR or NetCDF; `-` is standard input.
    pub fn open(path: &Path) -> Result<Self> {
        Self::from_bytes(&io::open(path)?, &io::name(path))
    }

    /// Reads a field, EXR or NetCDF, from memory; `name` stands for it in messages.
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self> {
        guarded(|| parse(bytes)).map_err(|refusal| refusal.about(name))
    }

    /// Checks before the work that a field can be saved under this name: see [`io::check_place`].
    pub fn check_place(path: &Path) -> Result<()> {
        Form::of(path)?;
        io::check_place(path)
    }

    /// Writes EXR, `.vti`, `.nc` (NetCDF) or `.csv` by extension; `-` and a name without extension are EXR. Refuses
    /// what [`Field::open`] refuses. Panics if a component is not as long as the shape asks.
    pub fn save(&self, path: &Path) -> Result<()> {
        self.save_with(path, &[])
    }

    /// Writes the field like [`Field::save`], with more numbers at every vector: channels of the EXR, arrays of the
    /// `.vti`, variables of the `.nc`, columns of the `.csv`. [`Field::open`] reads such a file as the
    /// field alone. Panics if an array is not as long as the layout asks.
    pub fn save_with(&self, path: &Path, more: &[Array]) -> Result<()> {
        for array in more {
            assert_eq!(array.values.len(), array.components * self.len(), "length of {}", array.name);
        }
        let refused = |refusal: Refusal| refusal.about(io::output_name(path));
        self.layout.check().map_err(refused)?;
        for ((name, ..), values) in CHANNELS.iter().zip(self.components()) {
            assert_eq!(Some(values.len()), self.layout.checked_len(), "length of component {name}");
        }
        self.check().map_err(refused)?;
        match Form::of(path)? {
            Form::Exr => {
                let bytes = guarded(|| self.to_exr(more)).map_err(refused)?;
                io::save(path, |out| out.write_all(&bytes))
            }
            Form::Vti => io::save(path, |out| write_vti(self, more, out)),
            Form::NetCdf => io::save(path, |out| write_cf(self, more, out)),
            Form::Csv => io::save_text(path, |out| write_csv(self, more, out)),
        }
    }

    fn to_exr(&self, more: &[Array]) -> std::result::Result<Vec<u8>, Refusal> {
        let [nx, ny, nz] = self.layout.shape;
        let names = CHANNELS.into_iter().map(|(name, ..)| name);
        let (more_names, more): (Vec<String>, Vec<Vec<f32>>) = more.iter().flat_map(Array::parts).unzip();
        let more = more_names.iter().map(String::as_str).zip(more);
        // The library wants values of its own.
        let channels = names.zip(self.components().map(<[f32]>::to_vec)).chain(more).collect();
        exr::write(nx, ny * nz, channels, Some((LAYOUT, self.layout.to_json())))
    }
}

/// The header of an EXR field and its layout, which fit each other.
fn head(bytes: &[u8]) -> std::result::Result<(exr::ExrHeader, VectorGrid), Refusal> {
    const WANTED: &str = "wanted a vector field in EXR";
    let found = || if bytes.is_empty() { "empty" } else { "not an EXR by its first bytes" };
    Refusal::unless(Signature::of(bytes) == Some(Signature::Exr), found, WANTED)?;
    let header = exr::ExrHeader::read(bytes)?;
    let Some(text) = header.text(LAYOUT) else {
        let found = format!("an EXR of channels {} without attribute {LAYOUT}", header.channels.join(", "));
        return Err(Refusal::new(found, WANTED));
    };
    let layout = VectorGrid::of_attribute(LAYOUT, &text, WANTED)?;
    let [nx, ny, nz] = layout.shape;
    let found = || format!("{} x {} pixels for a shape of {nx} x {ny} x {nz}", header.width, header.height);
    let fits = (header.width, Some(header.height)) == (nx, ny.checked_mul(nz));
    Refusal::unless(fits, found, "wanted nx x (ny nz) pixels")?;
    Ok((header, layout))
}

fn parse(bytes: &[u8]) -> std::result::Result<Field, Refusal> {
    if Signature::of(bytes) == Some(Signature::NetCdf) {
        return netcdf::parse(bytes);
    }
    let (header, layout) = head(bytes)?;
    let (has_count, pixels) = (header.channels.iter().any(|name| name == COUNT), header.width * header.height);
    let names = CHANNELS.iter().map(|(name, ..)| *name).filter(|name| has_count || *name != COUNT);
    let mut channels = exr::read(bytes, header, &names.collect::<Vec<_>>())?;
    // The count is the last channel.
    channels.resize(CHANNELS.len(), vec![f32::NAN; pixels]);
    let channels: [Vec<f32>; CHANNELS.len()] = channels.try_into().expect("one list a channel");
    let [u, v, w, peak, ratio, su, sv, sw, flag, count] = channels;
    let field = Field { layout, u, v, w, peak, ratio, su, sv, sw, flag, count };
    field.check().map(|()| field)
}
