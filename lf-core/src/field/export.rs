//! Fields for other programs: VTK image data (`.vti`) for ParaView, and text (`.csv`).
//!
//! A `.vti` has points on a regular grid in millimetres, and its arrays as raw bytes after the XML. Each array follows
//! its length in bytes (a `u64`, little-endian); its `offset` counts from the byte after the underscore. Units are in
//! the names of the arrays and in a comment, the frame is in another. The time between the volumes, if known, is the
//! field datum `dt_s`.

use super::{vector_grid::VectorGrid, vectors::Field};
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

impl Array {
    /// The components as lists of their own. Three are named `_x`, `_y`, `_z`, or as the name itself lists them:
    /// `strain_xy_xz_yz` has `strain_xy`, `strain_xz`, `strain_yz`, with the unit behind.
    pub(super) fn parts(&self) -> Vec<(String, Vec<f32>)> {
        if self.components == 1 {
            return vec![(self.name.to_owned(), self.values.clone())];
        }
        let part = |c: usize| self.values.iter().skip(c).step_by(self.components).copied().collect();
        (0..self.components).map(|c| (self.part_name(c), part(c))).collect()
    }

    fn part_name(&self, component: usize) -> String {
        for list in ["_xx_yy_zz", "_xy_xz_yz"] {
            if let Some((before, after)) = self.name.split_once(list) {
                let letters: Vec<&str> = list[1..].split('_').collect();
                return format!("{before}_{}{after}", letters[component]);
            }
        }
        let letter = ["x", "y", "z"][component];
        match self.name.split_once("_1_s") {
            Some((before, after)) => format!("{before}_{letter}_1_s{after}"),
            None => format!("{}_{letter}", self.name),
        }
    }
}

/// Writes arrays on the points of a layout as `.vti`, for results that a [`super::Field`] has no component for.
/// ParaView shows the first array with three components first. Panics if an array is not as long as the layout asks.
pub fn save_arrays(path: &Path, layout: &VectorGrid, arrays: &[Array]) -> Result<()> {
    layout.check().map_err(|refusal| refusal.about(io::output_name(path)))?;
    for array in arrays {
        assert_eq!(Some(array.values.len() / array.components), layout.checked_len(), "length of {}", array.name);
    }
    io::save(path, |out| write_vti(layout, arrays, out))
}

pub(super) fn write_vti(layout: &VectorGrid, arrays: &[Array], out: &mut dyn Write) -> std::io::Result<()> {
    let ([nx, ny, nz], [ox, oy, oz], [dx, dy, dz]) = (layout.shape.map(|n| n - 1), layout.origin_mm, layout.spacing_mm);
    let extent = format!("0 {nx} 0 {ny} 0 {nz}");
    writeln!(out, r#"<?xml version="1.0"?>"#)?;
    writeln!(out, r#"<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#)?;
    let dt = layout.dt_s.map_or("not known".into(), |dt_s| format!("{dt_s} s"));
    let units = "places in mm; an array's is the end of its name, mm_s for mm/s, and 1 where there is none.";
    writeln!(out, "<!-- Units: {units} -->")?;
    writeln!(out, "<!-- Frame: {MARK}; x right and y up in the picture, z towards the camera. -->")?;
    writeln!(out, "<!-- Time between the volumes: {dt}. -->")?;
    writeln!(out, r#"<ImageData WholeExtent="{extent}" Origin="{ox} {oy} {oz}" Spacing="{dx} {dy} {dz}">"#)?;
    if let Some(dt_s) = layout.dt_s {
        let array = r#"<DataArray type="Float64" Name="dt_s" NumberOfTuples="1" format="ascii">"#;
        writeln!(out, "<FieldData>{array}{dt_s}</DataArray></FieldData>")?;
    }
    writeln!(out, r#"<Piece Extent="{extent}">"#)?;
    let first = |components: usize| arrays.iter().find(|array| array.components == components).map_or("", |a| a.name);
    writeln!(out, r#"<PointData Vectors="{}" Scalars="{}">"#, first(3), first(1))?;
    let mut offset = 0;
    for Array { name, components, values } in arrays {
        let shape = format!(r#"Name="{name}" NumberOfComponents="{components}""#);
        writeln!(out, r#"<DataArray type="Float32" {shape} format="appended" offset="{offset}"/>"#)?;
        offset += size_of::<u64>() + size_of_val(values.as_slice());
    }
    writeln!(out, "</PointData>\n</Piece>\n</ImageData>")?;
    write!(out, "<AppendedData encoding=\"raw\">\n_")?;
    for Array { values, .. } in arrays {
        out.write_all(&(size_of_val(values.as_slice()) as u64).to_le_bytes())?;
        out.write_all(bytemuck::cast_slice(values))?;
    }
    writeln!(out, "\n</AppendedData>\n</VTKFile>")
}

/// A header line with units, then one vector a line, x fastest. Every number reads back to the same bits.
pub(super) fn write_csv(field: &Field, more: &[Array], out: &mut dyn Write) -> std::io::Result<()> {
    write!(out, "x_mm,y_mm,z_mm,u_mm,v_mm,w_mm,peak,ratio,su_mm,sv_mm,sw_mm,flag,count")?;
    write!(out, "{}", if field.layout.dt_s.is_some() { ",u_mm_s,v_mm_s,w_mm_s" } else { "" })?;
    let more: Vec<(String, Vec<f32>)> = more.iter().flat_map(Array::parts).collect();
    more.iter().try_for_each(|(name, _)| write!(out, ",{name}"))?;
    writeln!(out)?;
    let components = field.components();
    for i in 0..field.len() {
        let [x, y, z] = field.place_mm(i);
        write!(out, "{x},{y},{z}")?;
        let velocity = field.velocity_mm_s(i);
        for value in components.iter().map(|component| component[i]).chain(velocity.into_iter().flatten()) {
            write!(out, ",{value}")?;
        }
        more.iter().try_for_each(|(_, values)| write!(out, ",{}", values[i]))?;
        writeln!(out)?;
    }
    Ok(())
}
