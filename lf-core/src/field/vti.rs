//! A field as VTK image data, for ParaView: points on a regular grid in millimetres, arrays as raw bytes behind the XML.
//!
//! Each array stands behind its length in bytes (a `u64`), and its `offset` counts from the byte after the underscore. Units
//! are in the names of the arrays and in a comment; the time between the volumes is the field datum `dt_s`, where known.

use super::Field;
use std::io::{Result, Write};

pub(super) fn write(field: &Field, out: &mut dyn Write) -> Result<()> {
    let vectors = |[x, y, z]: [&[f32]; 3]| -> Vec<f32> { (0..x.len()).flat_map(|i| [x[i], y[i], z[i]]).collect() };
    let [u, v, w, peak, ratio, su, sv, sw, flag, count] = field.components();
    let mut arrays: Vec<(&str, usize, Vec<f32>)> = vec![
        ("displacement_mm", 3, vectors([u, v, w])),
        ("uncertainty_mm", 3, vectors([su, sv, sw])),
        ("peak", 1, peak.to_vec()),
        ("ratio", 1, ratio.to_vec()),
        ("flag", 1, flag.to_vec()),
        ("count", 1, count.to_vec()),
    ];
    if field.layout.dt_s.is_some() {
        arrays.push(("velocity_mm_s", 3, (0..field.len()).filter_map(|i| field.velocity_mm_s(i)).flatten().collect()));
    }

    let [nx, ny, nz] = field.layout.shape.map(|n| n - 1);
    let extent = format!("0 {nx} 0 {ny} 0 {nz}");
    let [ox, oy, oz] = field.layout.origin_mm;
    let [dx, dy, dz] = field.layout.spacing_mm;
    writeln!(out, r#"<?xml version="1.0"?>"#)?;
    writeln!(out, r#"<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#)?;
    let dt = field.layout.dt_s.map_or("not known".into(), |dt_s| format!("{dt_s} s"));
    writeln!(
        out,
        "<!-- Units: places, displacement_mm and uncertainty_mm in mm, velocity_mm_s in mm/s, the rest 1. -->"
    )?;
    writeln!(out, "<!-- Time between the volumes: {dt}. -->")?;
    writeln!(out, r#"<ImageData WholeExtent="{extent}" Origin="{ox} {oy} {oz}" Spacing="{dx} {dy} {dz}">"#)?;
    if let Some(dt_s) = field.layout.dt_s {
        let array = r#"<DataArray type="Float64" Name="dt_s" NumberOfTuples="1" format="ascii">"#;
        writeln!(out, "<FieldData>{array}{dt_s}</DataArray></FieldData>")?;
    }
    writeln!(out, r#"<Piece Extent="{extent}">"#)?;
    writeln!(out, r#"<PointData Vectors="displacement_mm" Scalars="peak">"#)?;
    let mut offset = 0;
    for (name, components, values) in &arrays {
        writeln!(
            out,
            r#"<DataArray type="Float32" Name="{name}" NumberOfComponents="{components}" format="appended" offset="{offset}"/>"#
        )?;
        offset += size_of::<u64>() + size_of_val(values.as_slice());
    }
    writeln!(out, "</PointData>\n</Piece>\n</ImageData>")?;
    write!(out, "<AppendedData encoding=\"raw\">\n_")?;
    for (_, _, values) in &arrays {
        out.write_all(&(size_of_val(values.as_slice()) as u64).to_le_bytes())?;
        out.write_all(bytemuck::cast_slice(values))?;
    }
    writeln!(out, "\n</AppendedData>\n</VTKFile>")
}
