//! Vector fields: EXR, `.vti`, `.csv`.
//!
//! The EXR is the format that stages exchange: one part, `f32` channels `u`, `v`, `w` (displacement, mm, in the object
//! frame of [`crate::optics`]), `peak`, `ratio`, `su`, `sv`, `sw` (standard uncertainty, mm) and `flag`, and one text
//! attribute `lf:field`, the JSON of [`Layout`]. A field of nx x ny x nz vectors is an image nx wide and ny nz high; vector
//! (i, j, k) is in column i of row k ny + j. The other two are for eyes: ParaView and a spreadsheet.

mod csv;
mod vti;

use crate::history::History;
use crate::image::{exr, guarded};
use crate::{Error, Result, io};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// `flag` of a measured vector.
pub const MEASURED: f32 = 0.0;
/// `flag` of a vector replaced from its neighbours.
pub const REPLACED: f32 = 1.0;
/// `flag` of a place without data.
pub const NO_DATA: f32 = 2.0;

/// The attribute that holds the layout.
const LAYOUT: &str = "lf:field";

const CHANNELS: [&str; 9] = ["u", "v", "w", "peak", "ratio", "su", "sv", "sw", "flag"];

/// Where a field's vectors stand and how they were made: the attribute `lf:field`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Layout {
    /// Vectors along x, y, z.
    pub shape: [usize; 3],
    /// Distance between vectors, mm.
    pub spacing_mm: [f64; 3],
    /// Place of vector (0, 0, 0), mm.
    pub origin_mm: [f64; 3],
    /// Voxel spacing of the volumes correlated, mm; zeros where there were none.
    pub voxel_mm: [f64; 3],
    /// Interrogation window of the last pass, voxels; zeros where there was none (a truth field).
    pub window: [usize; 3],
    /// Overlap of the last pass, 0 to 1.
    pub overlap: f64,
    /// The steps that led to it.
    #[serde(default)]
    pub history: History,
}

impl Layout {
    /// Number of vectors; none where a shape is empty or beyond counting.
    fn checked_len(&self) -> Option<usize> {
        self.shape.iter().try_fold(1usize, |product, &n| product.checked_mul(n)).filter(|&len| len > 0)
    }

    /// # Errors
    /// What was found and what was wanted.
    fn check(&self) -> std::result::Result<(), (String, String)> {
        let positive = |lengths: [f64; 3]| lengths.iter().all(|length| length.is_finite() && *length > 0.0);
        let wrong =
            |key: &str, value: String, wanted: &str| Err((format!("{key} {value}"), format!("wanted {wanted}")));
        if self.checked_len().is_none() {
            return wrong("shape", format!("{:?}", self.shape), "at least one vector an axis");
        }
        if !positive(self.spacing_mm) {
            return wrong("spacing_mm", format!("{:?}", self.spacing_mm), "positive lengths");
        }
        // Zero where no volume was correlated.
        if !self.voxel_mm.iter().all(|length| length.is_finite() && *length >= 0.0) {
            return wrong("voxel_mm", format!("{:?}", self.voxel_mm), "lengths that are not negative");
        }
        if !self.origin_mm.iter().all(|place| place.is_finite()) {
            return wrong("origin_mm", format!("{:?}", self.origin_mm), "finite lengths");
        }
        if !(0.0..=1.0).contains(&self.overlap) {
            return wrong("overlap", self.overlap.to_string(), "0 to 1");
        }
        Ok(())
    }
}

/// A field of vectors, each component in the order x fastest, then y, then z.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Where the vectors stand.
    pub layout: Layout,
    /// Displacement along x, mm.
    pub u: Vec<f32>,
    /// Displacement along y, mm.
    pub v: Vec<f32>,
    /// Displacement along z, mm.
    pub w: Vec<f32>,
    /// Normalised correlation at the peak, 0 to 1.
    pub peak: Vec<f32>,
    /// First to second peak.
    pub ratio: Vec<f32>,
    /// Standard uncertainty of u, mm; NaN where not estimated.
    pub su: Vec<f32>,
    /// Standard uncertainty of v, mm.
    pub sv: Vec<f32>,
    /// Standard uncertainty of w, mm.
    pub sw: Vec<f32>,
    /// [`MEASURED`], [`REPLACED`] or [`NO_DATA`].
    pub flag: Vec<f32>,
}

impl Field {
    /// A field of `layout.shape` vectors, all zero and [`NO_DATA`], uncertainties NaN.
    pub fn empty(layout: Layout) -> Self {
        let len = layout.shape.iter().product();
        let of = |value: f32| vec![value; len];
        let [u, v, w, peak, ratio] = [0.0; 5].map(of);
        let [su, sv, sw] = [f32::NAN; 3].map(of);
        Self { layout, u, v, w, peak, ratio, su, sv, sw, flag: of(NO_DATA) }
    }

    /// Number of vectors.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.flag.len()
    }

    /// Place of vector `i` of the components, mm.
    pub fn place_mm(&self, i: usize) -> [f64; 3] {
        let [nx, ny, _] = self.layout.shape;
        let step = [i % nx, i / nx % ny, i / nx / ny];
        [0, 1, 2].map(|axis| self.layout.origin_mm[axis] + step[axis] as f64 * self.layout.spacing_mm[axis])
    }

    /// Reads an EXR field; `-` is standard input.
    ///
    /// # Errors
    /// Another kind of file, missing channels, a layout that is not the image's, a flag that is none, and a displacement
    /// that is not finite where there is data.
    pub fn open(path: &Path) -> Result<Self> {
        Self::from_bytes(&io::open(path)?, &io::name(path))
    }

    /// Reads an EXR field from memory as [`Field::open`] does; `name` is what messages call it.
    ///
    /// # Errors
    /// As [`Field::open`].
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self> {
        guarded(|| Self::parse(bytes)).map_err(|(found, wanted)| Error::new(name, found, wanted))
    }

    fn parse(bytes: &[u8]) -> std::result::Result<Self, (String, String)> {
        let wanted = || "wanted a vector field in EXR".to_owned();
        if !bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            let found = if bytes.is_empty() { "empty" } else { "not an EXR by its first bytes" };
            return Err((found.into(), wanted()));
        }
        let header = exr::Header::read(bytes)?;
        let Some(text) = header.text(LAYOUT) else {
            let found = format!("an EXR of channels {} without attribute {LAYOUT}", header.channels.join(", "));
            return Err((found, wanted()));
        };
        let layout: Layout =
            serde_json::from_str(&text).map_err(|error| (format!("attribute {LAYOUT}: {error}"), wanted()))?;
        layout.check()?;
        let [nx, ny, nz] = layout.shape;
        if (header.width, Some(header.height)) != (nx, ny.checked_mul(nz)) {
            let found = format!("{} x {} pixels for a shape of {nx} x {ny} x {nz}", header.width, header.height);
            return Err((found, "wanted nx x (ny nz) pixels".into()));
        }
        let [u, v, w, peak, ratio, su, sv, sw, flag] = exr::read(bytes, header, CHANNELS)?;
        let field = Self { layout, u, v, w, peak, ratio, su, sv, sw, flag };
        field.check()?;
        Ok(field)
    }

    /// # Errors
    /// What was found and what was wanted.
    fn check(&self) -> std::result::Result<(), (String, String)> {
        for (i, &flag) in self.flag.iter().enumerate() {
            let known = [MEASURED, REPLACED, NO_DATA].contains(&flag);
            let vector = [self.u[i], self.v[i], self.w[i]];
            if known && (flag == NO_DATA || vector.iter().all(|component| component.is_finite())) {
                continue;
            }
            let [nx, ny, _] = self.layout.shape;
            let place = [i % nx, i / nx % ny, i / nx / ny];
            return Err(if known {
                (format!("displacement {vector:?} at vector {place:?}"), "wanted finite values or flag 2".into())
            } else {
                (format!("flag {flag} at vector {place:?}"), "wanted 0, 1 or 2".into())
            });
        }
        Ok(())
    }

    /// Writes EXR, `.vti` or `.csv` by extension; `-` is EXR on standard output, and so is a name without extension.
    ///
    /// # Errors
    /// Those of writing, a name that promises another format, and a field that [`Field::open`] would refuse.
    ///
    /// # Panics
    /// Where a component's length is not the shape's.
    pub fn save(&self, path: &Path) -> Result<()> {
        let refused = |(found, wanted): (String, String)| Error::new(io::output_name(path), found, wanted);
        self.layout.check().map_err(refused)?;
        for (name, values) in CHANNELS.iter().zip(self.components()) {
            assert_eq!(Some(values.len()), self.layout.checked_len(), "length of component {name}");
        }
        self.check().map_err(refused)?;
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            None | Some("exr") => {
                let bytes = guarded(|| self.to_exr()).map_err(refused)?;
                io::save(path, |out| out.write_all(&bytes))
            }
            Some("vti") => io::save(path, |out| vti::write(self, out)),
            Some("csv") => io::save_text(path, |out| csv::write(self, out)),
            Some(other) => Err(refused((format!("the extension .{other}"), "wanted .exr, .vti or .csv".into()))),
        }
    }

    /// In the order of [`CHANNELS`].
    fn components(&self) -> [&[f32]; 9] {
        [&self.u, &self.v, &self.w, &self.peak, &self.ratio, &self.su, &self.sv, &self.sw, &self.flag]
    }

    fn to_exr(&self) -> std::result::Result<Vec<u8>, (String, String)> {
        let [nx, ny, nz] = self.layout.shape;
        let layout = serde_json::to_string(&self.layout)
            .map_err(|error| (format!("its layout cannot be written ({error})"), "wanted plain numbers".into()))?;
        let channels = CHANNELS.into_iter().zip(self.components().map(<[f32]>::to_vec)).collect();
        exr::write(nx, ny * nz, channels, Some((LAYOUT, layout)))
    }
}
