//! Vector fields: EXR written and read, and the files for ParaView and spreadsheets.

use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::{Field, VectorGrid, history::Step};
use std::fs;
use std::path::Path;

fn layout(shape: [usize; 3]) -> VectorGrid {
    VectorGrid {
        shape,
        spacing_mm: [0.25, 0.5, 1.0],
        origin_mm: [-1.0, 2.0, 0.125],
        voxel_mm: [0.0058, 0.0058, 0.058],
        window: [160, 160, 16],
        overlap: 0.75,
        dt_s: None,
        history: vec![Step { tool: "lf-xcorr".into(), version: "0.1.0".into(), arguments: vec!["µ.lfv".into()] }],
    }
}

/// Every value encodes its component and its place.
fn field() -> Field {
    let mut field = Field::empty(layout([4, 3, 2]));
    let Field { u, v, w, peak, ratio, su, sv, sw, flag, count, .. } = &mut field;
    for (k, component) in [u, v, w, peak, ratio, su, sv, sw, count].into_iter().enumerate() {
        for (i, value) in component.iter_mut().enumerate() {
            *value = 100.0 * k as f32 + i as f32 + 0.1;
        }
    }
    flag.fill(MEASURED);
    flag[5] = REPLACED;
    flag[7] = NO_DATA;
    field.u[7] = f32::NAN;
    field.su[7] = f32::NAN;
    field.count[6] = f32::NAN;
    field.ratio[0] = f32::INFINITY;
    field
}

/// The field with 0.5 ms between the volumes: velocities are 2000 times the displacements.
fn timed() -> Field {
    let mut field = field();
    field.layout.dt_s = Some(0.0005);
    field
}

fn velocity(field: &Field, i: usize) -> [f32; 3] {
    [field.u[i], field.v[i], field.w[i]].map(|mm| (mm as f64 / 0.0005) as f32)
}

fn written(field: &Field, name: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    field.save(&path).unwrap();
    fs::read(path).unwrap()
}

fn bits(field: &Field) -> Vec<u32> {
    let Field { layout: _, u, v, w, peak, ratio, su, sv, sw, flag, count } = field;
    [u, v, w, peak, ratio, su, sv, sw, flag, count].into_iter().flatten().map(|value| value.to_bits()).collect()
}

fn refusal(bytes: &[u8]) -> String {
    match Field::from_bytes(bytes, "field") {
        Ok(_) => panic!("should be refused"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn an_empty_field_says_that_it_is() {
    let field = Field::empty(layout([2, 2, 1]));
    assert_eq!((field.len(), field.u[3], field.flag[3]), (4, 0.0, NO_DATA));
    assert!(field.sw[3].is_nan() && field.count[3].is_nan());
    assert_eq!(field.place_mm(3), [-0.75, 2.5, 0.125]);
}

#[test]
fn a_round_trip_changes_nothing_and_equal_fields_are_equal_bytes() {
    let field = field();
    let first = written(&field, "field.exr");
    for _ in 0..20 {
        assert!(written(&field, "field.EXR") == first);
    }
    let back = Field::from_bytes(&first, "field").unwrap();
    assert_eq!(back.layout, field.layout);
    assert_eq!(bits(&back), bits(&field));

    let timed = timed();
    let back = Field::from_bytes(&written(&timed, "field.exr"), "field").unwrap();
    assert_eq!(back.layout, timed.layout);
    assert_eq!(bits(&back), bits(&timed));
}

#[test]
fn vector_i_j_k_is_in_column_i_of_row_k_ny_plus_j() {
    use exr::prelude::*;
    let bytes = written(&field(), "field.exr");
    let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let layer = image.from_buffered(std::io::Cursor::new(&bytes)).unwrap().layer_data;
    assert_eq!(layer.size, Vec2(4, 6));
    let names: Vec<String> = layer.channel_data.list.iter().map(|channel| channel.name.to_string()).collect();
    assert_eq!(names, ["count", "flag", "peak", "ratio", "su", "sv", "sw", "u", "v", "w"]);
    let w: Vec<f32> = layer.channel_data.list[9].sample_data.values_as_f32().collect();
    let (i, j, k) = (3, 1, 1);
    assert_eq!(w[(k * 3 + j) * 4 + i], 200.0 + (i + 4 * (j + 3 * k)) as f32 + 0.1);
}

#[test]
fn other_images_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    lf_core::image::save(&path, &ndarray::Array2::zeros((2, 2)), &Vec::new()).unwrap();
    let bytes = fs::read(&path).unwrap();
    assert_eq!(refusal(&bytes), "field: an EXR of channels Y without attribute lf:field; wanted a vector field in EXR");
    assert_eq!(refusal(b"x_mm,y_mm"), "field: not an EXR by its first bytes; wanted a vector field in EXR");
    assert_eq!(refusal(b""), "field: empty; wanted a vector field in EXR");
}

/// 4 x 6 pixels of named channels. All but the flag are 1 everywhere; `layout` is any text.
fn file(names: &[&str], json: &str) -> Vec<u8> {
    use exr::prelude::*;
    let value = |name: &str| f32::from(u8::from(name != "flag"));
    let channel = |name: &&str| AnyChannel::new(*name, FlatSamples::F32(vec![value(name); 24]));
    let list = names.iter().map(channel).collect::<SmallVec<_>>();
    let mut attributes = LayerAttributes::default();
    attributes.other.insert("lf:field".into(), attribute::AttributeValue::Text(json.into()));
    let layer = Layer::new((4, 6), attributes, Encoding::UNCOMPRESSED, AnyChannels::sort(list));
    let mut file = std::io::Cursor::new(Vec::new());
    exr::image::Image::from_layer(layer).write().to_buffered(&mut file).unwrap();
    file.into_inner()
}

const REQUIRED: [&str; 9] = ["u", "v", "w", "peak", "ratio", "su", "sv", "sw", "flag"];
const GOOD: &str = r#"{"frame": "right-handed", "shape": [4, 3, 2], "spacing_mm": [1, 1, 1], "origin_mm": [0, 0, 0], "voxel_mm": [0, 0, 0], "window": [0, 0, 0], "overlap": 0}"#;

#[test]
fn a_file_may_lack_the_count_the_time_and_the_history() {
    let field = Field::from_bytes(&file(&REQUIRED, GOOD), "field").unwrap();
    assert!(field.layout.history.is_empty() && field.layout.dt_s.is_none());
    assert!(field.count.len() == 24 && field.count.iter().all(|count| count.is_nan()));
    let counted = Field::from_bytes(&file(&[&REQUIRED[..], &["count"]].concat(), GOOD), "field").unwrap();
    assert_eq!(counted.count, [1.0; 24]);
}

#[test]
fn units_are_written_for_every_channel_and_ignored_when_read() {
    use exr::meta::{MetaData, attribute::AttributeValue};
    for (field, dt) in [(field(), None), (timed(), Some(0.0005))] {
        let meta = MetaData::read_from_buffered(std::io::Cursor::new(written(&field, "field.exr")), false).unwrap();
        let AttributeValue::Text(text) = &meta.headers[0].own_attributes.other[&b"lf:field"[..]] else { panic!() };
        let json: serde_json::Value = serde_json::from_str(&text.to_string()).unwrap();
        let units = json["units"].as_object().unwrap();
        let named: Vec<_> = units.iter().map(|(name, unit)| format!("{name} {}", unit.as_str().unwrap())).collect();
        assert_eq!(named.join(", "), "u mm, v mm, w mm, peak 1, ratio 1, su mm, sv mm, sw mm, flag 1, count 1");
        assert_eq!(json.get("dt_s").and_then(serde_json::Value::as_f64), dt);
    }
    let strange = GOOD.replace("\"overlap\"", "\"units\": {\"u\": \"inch\"}, \"overlap\"");
    assert_eq!(Field::from_bytes(&file(&REQUIRED, &strange), "field").unwrap().u[0], 1.0);
}

#[test]
fn a_time_that_is_not_positive_is_refused_both_ways() {
    let folder = tempfile::tempdir().unwrap();
    for (dt_s, shown) in [(0.0, "0"), (-1e-3, "-0.001"), (f64::NAN, "NaN"), (f64::INFINITY, "inf")] {
        let mut field = field();
        field.layout.dt_s = Some(dt_s);
        let refused = field.save(&folder.path().join("field.exr")).unwrap_err().to_string();
        assert!(refused.ends_with(&format!("dt_s {shown}; wanted a positive time")), "{refused}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    for (dt_s, message) in [("0", "dt_s 0;"), ("-2", "dt_s -2;"), ("NaN", "attribute lf:field"), ("\"1\"", "string")] {
        let json = GOOD.replace("\"overlap\"", &format!("\"dt_s\": {dt_s}, \"overlap\""));
        let refusal = refusal(&file(&REQUIRED, &json));
        assert!(refusal.starts_with("field: ") && refusal.contains(message), "{refusal}");
    }
}

#[test]
fn missing_channels_and_false_layouts_are_named() {
    let found = refusal(&file(&["u", "v", "peak", "ratio", "su", "sv", "sw"], GOOD));
    assert!(found.starts_with("field: channels peak, ratio, su, sv, sw, u, v without w, flag; wanted"), "{found}");
    let changes = [
        ("[4, 3, 2]", "[3, 4, 2]", "4 x 6 pixels for a shape of 3 x 4 x 2"),
        ("[4, 3, 2]", "[4, 3, 0]", "shape [4, 3, 0]"),
        ("[4, 3, 2]", "[4, 4294967296, 4294967296]", "shape [4, 4294967296, 4294967296]"),
        ("[1, 1, 1]", "[1, -1, 1]", "spacing_mm"),
        ("\"overlap\": 0", "\"overlap\": 2", "overlap 2"),
        ("\"overlap\": 0", "\"over\": 0", "missing field `overlap`"),
        (
            "\"frame\"",
            "\"before\"",
            "names no frame: lf 0.1.0 wrote it, with x to the left; wanted \"frame\": \"right-handed\"",
        ),
        ("right-handed", "left-handed", "the frame \"left-handed\"; wanted \"frame\": \"right-handed\""),
    ];
    for (from, to, message) in changes {
        let refusal = refusal(&file(&REQUIRED, &GOOD.replace(from, to)));
        assert!(refusal.starts_with("field: ") && refusal.contains(message), "{refusal}");
    }
}

#[test]
fn an_invalid_field_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field.exr");
    let mut bad = field();
    bad.v[1] = f32::NAN;
    let refused = bad.save(&path).unwrap_err().to_string();
    assert!(refused.contains("at vector [1, 0, 0]; wanted finite values or flag 2"), "{refused}");
    bad = field();
    bad.flag[23] = 3.0;
    let refused = bad.save(&path).unwrap_err().to_string();
    assert!(refused.contains("flag 3 at vector [3, 2, 1]"), "{refused}");
    let refused = field().save(&folder.path().join("field.vtk")).unwrap_err().to_string();
    assert!(refused.contains("the extension .vtk; wanted .exr, .vti, .nc or .csv"), "{refused}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    field().save(Path::new("/dev/null")).unwrap();
}

/// `from` is replaced by `to`, of the same length.
fn replaced(mut bytes: Vec<u8>, from: &str, to: &str) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|part| part == from.as_bytes()).unwrap();
    bytes[at..at + from.len()].copy_from_slice(to.as_bytes());
    bytes
}

#[test]
fn a_netcdf_is_read_with_its_layout_or_without() {
    let mut field = timed();
    field.flag[7] = NO_DATA;
    (field.u[7], field.v[7], field.w[7]) = (0.0, 0.0, 0.0);
    let bytes = written(&field, "field.nc");
    let whole = Field::from_bytes(&bytes, "field").unwrap();
    assert_eq!((bits(&whole), &whole.layout), (bits(&field), &field.layout));
    // Another program knows no attribute lf_field.
    let other = Field::from_bytes(&replaced(bytes, "lf_field", "no_field"), "field").unwrap();
    assert_eq!((bits(&other), other.layout.shape), (bits(&field), field.layout.shape));
    for axis in 0..3 {
        assert!((other.layout.origin_mm[axis] - field.layout.origin_mm[axis]).abs() < 1e-12);
        assert!((other.layout.spacing_mm[axis] - field.layout.spacing_mm[axis]).abs() < 1e-12);
    }
    assert_eq!(other.layout.voxel_mm, [0.0; 3]);
}

#[test]
fn a_netcdf_that_is_no_field_is_refused() {
    let bytes = written(&field(), "field.nc");
    let axis = replaced(bytes.clone(), "axis", "lost");
    assert!(Field::from_bytes(&axis, "field").is_ok());
    for (wrong, message) in [
        (bytes[..bytes.len() - 1].to_vec(), "cut short"),
        (bytes[..40].to_vec(), "cut short"),
        (b"\x89HDF\r\n\x1a\n".to_vec(), "NetCDF-4, which is HDF5"),
        (replaced(bytes.clone(), "CDF\x02", "CDF\x05"), "another version"),
        (replaced(bytes, "\x00\x00\x00\x01u\x00\x00\x00", "\x00\x00\x00\x01q\x00\x00\x00"), "without u"),
    ] {
        let found = refusal(&wrong);
        assert!(found.contains(message) && found.contains("wanted NetCDF"), "{found}");
    }
}

#[test]
fn a_csv_has_units_and_every_bit() {
    let field = field();
    let text = String::from_utf8(written(&field, "field.csv")).unwrap();
    let mut lines = text.lines();
    let header = "x_mm,y_mm,z_mm,u_mm,v_mm,w_mm,peak,ratio,su_mm,sv_mm,sw_mm,flag,count";
    assert_eq!(lines.next().unwrap(), header);
    for (i, line) in lines.enumerate() {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        assert_eq!(numbers.len(), 13);
        assert_eq!(numbers[..3], field.place_mm(i));
        assert_eq!((numbers[4] as f32, numbers[5] as f32), (field.v[i], field.w[i]));
        assert_eq!(numbers[11] as f32, field.flag[i]);
        assert_eq!((numbers[12] as f32).to_bits(), field.count[i].to_bits());
    }
    assert_eq!(text.lines().count(), 25);
    assert!(text.contains("NaN") && text.contains(",inf,"));

    let timed = timed();
    let text = String::from_utf8(written(&timed, "field.csv")).unwrap();
    let (first, rest) = text.split_once('\n').unwrap();
    assert_eq!(first, format!("{header},u_mm_s,v_mm_s,w_mm_s"));
    for (i, line) in rest.lines().enumerate() {
        let numbers: Vec<f32> = line.split(',').map(|number| number.parse().unwrap()).collect();
        assert_eq!(numbers.len(), 16);
        assert_eq!([13, 14, 15].map(|k: usize| numbers[k].to_bits()), velocity(&timed, i).map(f32::to_bits));
    }
}

/// Reads the XML like VTK: offsets count from the byte after the underscore, and a length precedes each array.
#[test]
fn a_vti_finds_its_arrays() {
    let (names, xml) = arrays(&field());
    assert_eq!(names, ["displacement_mm", "uncertainty_mm", "peak", "ratio", "flag", "count"]);
    assert!(xml.contains(r#"WholeExtent="0 3 0 2 0 1" Origin="-1 2 0.125" Spacing="0.25 0.5 1""#), "{xml}");
    assert!(xml.contains("<!-- Time between the volumes: not known. -->") && !xml.contains("dt_s"), "{xml}");
    let (names, xml) = arrays(&timed());
    assert_eq!(names, ["displacement_mm", "uncertainty_mm", "peak", "ratio", "flag", "count", "velocity_mm_s"]);
    assert!(xml.contains(r#"Name="dt_s" NumberOfTuples="1" format="ascii">0.0005</DataArray></FieldData>"#), "{xml}");
    assert!(xml.contains("0.0005 s. -->") && xml.contains("an array's is the end of its name"), "{xml}");
}

/// The names of the arrays of a `.vti`, and its XML. Checks the values.
fn arrays(field: &Field) -> (Vec<String>, String) {
    let bytes = written(field, "field.vti");
    let mark = b"<AppendedData encoding=\"raw\">\n_";
    let start = bytes.windows(mark.len()).position(|window| window == mark).unwrap() + mark.len();
    let xml = std::str::from_utf8(&bytes[..start]).unwrap();
    let attribute = |line: &str, name: &str| -> String {
        line.split_once(&format!("{name}=\"")).unwrap().1.split_once('"').unwrap().0.to_owned()
    };
    let mut end = start;
    let mut names = Vec::new();
    for line in xml.lines().filter(|line| line.starts_with("<DataArray")) {
        let components: usize = attribute(line, "NumberOfComponents").parse().unwrap();
        let offset: usize = attribute(line, "offset").parse().unwrap();
        let name = attribute(line, "Name");
        let length = u64::from_le_bytes(bytes[start + offset..][..8].try_into().unwrap()) as usize;
        assert_eq!(length, 4 * components * field.len());
        assert_eq!(start + offset, end, "{name} begins where the one before ends");
        let values: Vec<f32> = bytes[end + 8..end + 8 + length]
            .chunks(4)
            .map(|value| f32::from_le_bytes(value.try_into().unwrap()))
            .collect();
        match name.as_str() {
            "displacement_mm" => assert_eq!(values[3 * 9..][..3], [field.u[9], field.v[9], field.w[9]]),
            "uncertainty_mm" => assert_eq!(values[3 * 9..][..3], [field.su[9], field.sv[9], field.sw[9]]),
            "velocity_mm_s" => assert_eq!(values[3 * 9..][..3], velocity(field, 9)),
            "count" => assert_eq!((components, values[9]), (1, field.count[9])),
            _ => assert_eq!(components, 1),
        }
        end += 8 + length;
        names.push(name);
    }
    assert_eq!(&bytes[end..], b"\n</AppendedData>\n</VTKFile>\n");
    (names, xml.to_owned())
}
