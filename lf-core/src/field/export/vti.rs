//! VTK image data (`.vti`) for ParaView: arrays on a regular grid of points in millimetres.
//!
//! The arrays are raw bytes after the XML. Each follows its length in bytes (a `u64`, little-endian); its `offset`
//! counts from the byte after the underscore. Units are in the names of the arrays and in a comment, the frame is in
//! another. The field data hold `dt_s`, the time between the volumes if it is known, and `history`, a line for each
//! step that led to the file.

use crate::field::{vector_grid::VectorGrid, vectors::Field};
use crate::history::{self, History};
use crate::{Result, frame::MARK, io};
use std::{io::Write, path::Path};

/// Numbers at every vector of a field; the components of one vector are neighbours.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Name, with the unit last if it has one.
    pub name: &'static str,
    /// Numbers at each vector.
    pub components: usize,
    /// Vectors times components, x fastest.
    pub values: Vec<f32>,
}

impl Array {
    /// One number at each vector.
    pub fn scalars(name: &'static str, values: &[f32]) -> Self {
        Self { name, components: 1, values: values.to_vec() }
    }

    /// Three numbers at each vector, from three lists of equal length.
    pub fn vectors(name: &'static str, [x, y, z]: [&[f32]; 3]) -> Self {
        Self { name, components: 3, values: (0..x.len()).flat_map(|i| [x[i], y[i], z[i]]).collect() }
    }
}

/// The head and the end of a `.vti`. Its arrays stand between them, one after the other.
#[derive(Debug, Clone)]
pub struct ImageData<'a> {
    /// Points along x, y, z.
    pub shape: [usize; 3],
    /// Distance between points, mm.
    pub spacing_mm: [f64; 3],
    /// Place of point (0, 0, 0), mm.
    pub origin_mm: [f64; 3],
    /// Time between two volumes, s.
    pub dt_s: Option<f64>,
    /// The steps that led to the file.
    pub history: &'a History,
    /// Name and number of components of each array.
    pub arrays: Vec<(&'a str, usize)>,
}

impl ImageData<'_> {
    /// Writes the file. `fill` writes all values of array `n` as little-endian `f32`, x fastest.
    pub fn write(
        &self,
        out: &mut dyn Write,
        mut fill: impl FnMut(usize, &mut dyn Write) -> std::io::Result<()>,
    ) -> std::io::Result<()> {
        self.head(out)?;
        for (n, (_, components)) in self.arrays.iter().enumerate() {
            out.write_all(&self.bytes(*components).to_le_bytes())?;
            fill(n, out)?;
        }
        writeln!(out, "\n</AppendedData>\n</VTKFile>")
    }

    /// Bytes of an array.
    fn bytes(&self, components: usize) -> u64 {
        self.shape.iter().chain([&components, &size_of::<f32>()]).map(|&n| n as u64).product()
    }

    fn head(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let ([nx, ny, nz], [ox, oy, oz], [dx, dy, dz]) = (self.shape.map(|n| n - 1), self.origin_mm, self.spacing_mm);
        let extent = format!("0 {nx} 0 {ny} 0 {nz}");
        writeln!(out, r#"<?xml version="1.0"?>"#)?;
        writeln!(out, r#"<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#)?;
        let dt = self.dt_s.map_or("not known".into(), |dt_s| format!("{dt_s} s"));
        let units = "places in mm; an array's is the end of its name, mm_s for mm/s, and 1 for a name without one.";
        writeln!(out, "<!-- Units: {units} -->")?;
        writeln!(out, "<!-- Frame: {MARK}; x right and y up in the picture, z towards the camera. -->")?;
        writeln!(out, "<!-- Time between the volumes: {dt}. -->")?;
        writeln!(out, r#"<ImageData WholeExtent="{extent}" Origin="{ox} {oy} {oz}" Spacing="{dx} {dy} {dz}">"#)?;
        write_field_data(out, self.dt_s, self.history)?;
        writeln!(out, r#"<Piece Extent="{extent}">"#)?;
        let first = |wanted: usize| self.arrays.iter().find(|(_, n)| *n == wanted).map_or("", |(name, _)| name);
        writeln!(out, r#"<PointData Vectors="{}" Scalars="{}">"#, first(3), first(1))?;
        let mut offset = 0;
        for (name, components) in &self.arrays {
            let shape = format!(r#"Name="{name}" NumberOfComponents="{components}""#);
            writeln!(out, r#"<DataArray type="Float32" {shape} format="appended" offset="{offset}"/>"#)?;
            offset += size_of::<u64>() as u64 + self.bytes(*components);
        }
        writeln!(out, "</PointData>\n</Piece>\n</ImageData>")?;
        write!(out, "<AppendedData encoding=\"raw\">\n_")
    }
}

/// Writes the element `FieldData` of a VTK file: `dt_s`, and `history` as numbers of letters, one string a step.
pub fn write_field_data(out: &mut dyn Write, dt_s: Option<f64>, history: &History) -> std::io::Result<()> {
    if dt_s.is_none() && history.is_empty() {
        return Ok(());
    }
    write!(out, "<FieldData>")?;
    if !history.is_empty() {
        let count = history.len();
        write!(out, r#"<Array type="String" Name="history" NumberOfTuples="{count}" format="ascii">"#)?;
        for byte in history::lines(history).iter().flat_map(|line| line.bytes().chain([0])) {
            write!(out, "{byte} ")?;
        }
        write!(out, "</Array>")?;
    }
    if let Some(dt_s) = dt_s {
        let array = r#"<DataArray type="Float64" Name="dt_s" NumberOfTuples="1" format="ascii">"#;
        write!(out, "{array}{dt_s}</DataArray>")?;
    }
    writeln!(out, "</FieldData>")
}

/// Writes arrays on the points of a layout as `.vti`, for results that a [`Field`] has no component for.
/// ParaView shows the first array with three components first. Panics if an array is not as long as the layout asks.
pub fn save_arrays(path: &Path, layout: &VectorGrid, arrays: &[Array]) -> Result<()> {
    layout.check().map_err(|refusal| refusal.about(io::output_name(path)))?;
    for array in arrays {
        assert_eq!(Some(array.values.len() / array.components), layout.checked_len(), "length of {}", array.name);
    }
    io::save(path, |out| write_arrays(layout, &arrays.iter().collect::<Vec<_>>(), out))
}

/// Writes a field.
pub(in crate::field) fn write_vti(field: &Field, more: &[Array], out: &mut dyn Write) -> std::io::Result<()> {
    let own = arrays(field);
    write_arrays(&field.layout, &own.iter().chain(more).collect::<Vec<_>>(), out)
}

fn write_arrays(layout: &VectorGrid, arrays: &[&Array], out: &mut dyn Write) -> std::io::Result<()> {
    let image = ImageData {
        shape: layout.shape,
        spacing_mm: layout.spacing_mm,
        origin_mm: layout.origin_mm,
        dt_s: layout.dt_s,
        history: &layout.history,
        arrays: arrays.iter().map(|array| (array.name, array.components)).collect(),
    };
    image.write(out, |n, out| out.write_all(bytemuck::cast_slice(&arrays[n].values)))
}

/// The arrays of a field.
fn arrays(field: &Field) -> Vec<Array> {
    let [u, v, w, peak, ratio, su, sv, sw, flag, count] = field.components();
    let mut arrays = vec![
        Array::vectors("displacement_mm", [u, v, w]),
        Array::vectors("uncertainty_mm", [su, sv, sw]),
        Array::scalars("peak", peak),
        Array::scalars("ratio", ratio),
        Array::scalars("flag", flag),
        Array::scalars("count", count),
    ];
    if field.layout.dt_s.is_some() {
        let velocities = (0..field.len()).filter_map(|i| field.velocity_mm_s(i)).flatten().collect();
        arrays.push(Array { name: "velocity_mm_s", components: 3, values: velocities });
    }
    arrays
}
