//! Vector fields: EXR, `.vti`, `.csv`.
//!
//! The EXR is the format that stages exchange: one part, `f32` channels `u`, `v`, `w` (displacement, mm, in the object
//! frame of [`crate::optics`]), `peak`, `ratio`, `su`, `sv`, `sw` (standard uncertainty, mm), `flag` and `count` (particle
//! images in the window; a file may lack it), and one text attribute `lf:field`, the JSON of [`Layout`] and of `units`, the
//! unit of every channel, which is not read. A field of nx x ny x nz vectors is an image nx wide and ny nz high; vector
//! (i, j, k) is in column i of row k ny + j. The other two are for eyes: ParaView and a spreadsheet. They hold the
//! velocity, mm/s, as well where the time between the volumes is known.

mod csv;
mod cut;
mod layout;
mod vti;

pub use cut::Cut;
pub use layout::Layout;
pub use vti::Array;

use crate::image::{exr, guarded};
use crate::{Error, Result, io};
use std::path::Path;

/// `flag` of a measured vector.
pub const MEASURED: f32 = 0.0;
/// `flag` of a vector replaced from its neighbours.
pub const REPLACED: f32 = 1.0;
/// `flag` of a place without data.
pub const NO_DATA: f32 = 2.0;

/// The attribute that holds the layout.
const LAYOUT: &str = "lf:field";

/// The components as channels, with their units, in the order of [`Field::components`].
const COMPONENTS: [(&str, &str); 10] = [
    ("u", "mm"),
    ("v", "mm"),
    ("w", "mm"),
    ("peak", "1"),
    ("ratio", "1"),
    ("su", "mm"),
    ("sv", "mm"),
    ("sw", "mm"),
    ("flag", "1"),
    ("count", "1"),
];

/// The channels that every file has.
const REQUIRED: [&str; 9] = ["u", "v", "w", "peak", "ratio", "su", "sv", "sw", "flag"];
/// The channel that a file may lack.
const COUNT: &str = "count";

/// Writes arrays at the places of a layout as `.vti`, for what a [`Field`] has no component for. The first has three
/// components; ParaView shows it first.
///
/// # Errors
/// Those of writing, and a layout that is none.
///
/// # Panics
/// Where an array's length is not the layout's.
pub fn save_arrays(path: &Path, layout: &Layout, arrays: &[Array]) -> Result<()> {
    layout.check().map_err(|(found, wanted)| Error::new(io::output_name(path), found, wanted))?;
    for array in arrays {
        assert_eq!(Some(array.values.len() / array.components), layout.checked_len(), "length of {}", array.name);
    }
    io::save(path, |out| vti::write(layout, arrays, out))
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
    /// Particle images in the vector's window; NaN where not counted.
    pub count: Vec<f32>,
}

impl Field {
    /// A field of `layout.shape` vectors, all zero and [`NO_DATA`], uncertainties and counts NaN.
    pub fn empty(layout: Layout) -> Self {
        let len = layout.shape.iter().product();
        let of = |value: f32| vec![value; len];
        let [u, v, w, peak, ratio] = [0.0; 5].map(of);
        let [su, sv, sw, count] = [f32::NAN; 4].map(of);
        Self { layout, u, v, w, peak, ratio, su, sv, sw, flag: of(NO_DATA), count }
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
        let [u, v, w, peak, ratio, su, sv, sw, flag, count] = if header.channels.iter().any(|name| name == COUNT) {
            exr::read(bytes, header, COMPONENTS.map(|(name, _)| name))?
        } else {
            let [u, v, w, peak, ratio, su, sv, sw, flag] = exr::read(bytes, header, REQUIRED)?;
            let count = vec![f32::NAN; flag.len()];
            [u, v, w, peak, ratio, su, sv, sw, flag, count]
        };
        let field = Self { layout, u, v, w, peak, ratio, su, sv, sw, flag, count };
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
        for ((name, _), values) in COMPONENTS.iter().zip(self.components()) {
            assert_eq!(Some(values.len()), self.layout.checked_len(), "length of component {name}");
        }
        self.check().map_err(refused)?;
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            None | Some("exr") => {
                let bytes = guarded(|| self.to_exr()).map_err(refused)?;
                io::save(path, |out| out.write_all(&bytes))
            }
            Some("vti") => io::save(path, |out| vti::write(&self.layout, &self.to_arrays(), out)),
            Some("csv") => io::save_text(path, |out| csv::write(self, out)),
            Some(other) => Err(refused((format!("the extension .{other}"), "wanted .exr, .vti or .csv".into()))),
        }
    }

    /// In the order of [`COMPONENTS`].
    fn components(&self) -> [&[f32]; 10] {
        let Self { layout: _, u, v, w, peak, ratio, su, sv, sw, flag, count } = self;
        [u, v, w, peak, ratio, su, sv, sw, flag, count].map(Vec::as_slice)
    }

    /// Velocity of vector `i`, mm/s; none where the time between the volumes is not known.
    fn velocity_mm_s(&self, i: usize) -> Option<[f32; 3]> {
        let dt_s = self.layout.dt_s?;
        Some([self.u[i], self.v[i], self.w[i]].map(|mm| (f64::from(mm) / dt_s) as f32))
    }

    /// What a `.vti` holds of it.
    fn to_arrays(&self) -> Vec<Array> {
        let [u, v, w, peak, ratio, su, sv, sw, flag, count] = self.components();
        let mut arrays = vec![
            Array::vectors("displacement_mm", [u, v, w]),
            Array::vectors("uncertainty_mm", [su, sv, sw]),
            Array::scalars("peak", peak),
            Array::scalars("ratio", ratio),
            Array::scalars("flag", flag),
            Array::scalars("count", count),
        ];
        if self.layout.dt_s.is_some() {
            let velocities = (0..self.len()).filter_map(|i| self.velocity_mm_s(i)).flatten().collect();
            arrays.push(Array { name: "velocity_mm_s", components: 3, values: velocities });
        }
        arrays
    }

    fn to_exr(&self) -> std::result::Result<Vec<u8>, (String, String)> {
        let [nx, ny, nz] = self.layout.shape;
        let names = COMPONENTS.into_iter().map(|(name, _)| name);
        let channels = names.zip(self.components().map(<[f32]>::to_vec)).collect();
        exr::write(nx, ny * nz, channels, Some((LAYOUT, self.layout.to_json()?)))
    }
}
