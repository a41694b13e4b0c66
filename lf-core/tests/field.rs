//! Vector fields: EXR there and back, and what ParaView and a spreadsheet get.

use lf_core::field::{Field, Layout, MEASURED, NO_DATA, REPLACED};
use lf_core::history::Step;
use std::fs;
use std::path::Path;

fn layout(shape: [usize; 3]) -> Layout {
    Layout {
        shape,
        spacing_mm: [0.25, 0.5, 1.0],
        origin_mm: [-1.0, 2.0, 0.125],
        voxel_mm: [0.0058, 0.0058, 0.058],
        window: [160, 160, 16],
        overlap: 0.75,
        history: vec![Step { tool: "lf-xcorr".into(), version: "0.1.0".into(), arguments: vec!["µ.lfv".into()] }],
    }
}

/// Every value tells its component and its place.
fn field() -> Field {
    let mut field = Field::empty(layout([4, 3, 2]));
    let Field { u, v, w, peak, ratio, su, sv, sw, flag, .. } = &mut field;
    for (k, component) in [u, v, w, peak, ratio, su, sv, sw].into_iter().enumerate() {
        for (i, value) in component.iter_mut().enumerate() {
            *value = 100.0 * k as f32 + i as f32 + 0.1;
        }
    }
    flag.fill(MEASURED);
    flag[5] = REPLACED;
    flag[7] = NO_DATA;
    field.u[7] = f32::NAN;
    field.su[7] = f32::NAN;
    field.ratio[0] = f32::INFINITY;
    field
}

fn written(field: &Field, name: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    field.save(&path).unwrap();
    fs::read(path).unwrap()
}

fn bits(field: &Field) -> Vec<u32> {
    let Field { u, v, w, peak, ratio, su, sv, sw, flag, .. } = field;
    [u, v, w, peak, ratio, su, sv, sw, flag].into_iter().flatten().map(|value| value.to_bits()).collect()
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
    assert!(field.sw[3].is_nan());
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
}

#[test]
fn vector_i_j_k_is_in_column_i_of_row_k_ny_plus_j() {
    use exr::prelude::*;
    let bytes = written(&field(), "field.exr");
    let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let layer = image.from_buffered(std::io::Cursor::new(&bytes)).unwrap().layer_data;
    assert_eq!(layer.size, Vec2(4, 6));
    let names: Vec<String> = layer.channel_data.list.iter().map(|channel| channel.name.to_string()).collect();
    assert_eq!(names, ["flag", "peak", "ratio", "su", "sv", "sw", "u", "v", "w"]);
    let w: Vec<f32> = layer.channel_data.list[8].sample_data.values_as_f32().collect();
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

#[test]
fn missing_channels_and_false_layouts_are_named() {
    use exr::prelude::*;
    let file = |names: &[&str], json: &str| {
        let list =
            names.iter().map(|name| AnyChannel::new(*name, FlatSamples::F32(vec![0.0; 24]))).collect::<SmallVec<_>>();
        let mut attributes = LayerAttributes::default();
        attributes.other.insert("lf:field".into(), attribute::AttributeValue::Text(json.into()));
        let layer = Layer::new((4, 6), attributes, Encoding::UNCOMPRESSED, AnyChannels::sort(list));
        let mut file = std::io::Cursor::new(Vec::new());
        exr::image::Image::from_layer(layer).write().to_buffered(&mut file).unwrap();
        file.into_inner()
    };
    let all = ["u", "v", "w", "peak", "ratio", "su", "sv", "sw", "flag"];
    let good = r#"{"shape": [4, 3, 2], "spacing_mm": [1, 1, 1], "origin_mm": [0, 0, 0], "voxel_mm": [0, 0, 0], "window": [0, 0, 0], "overlap": 0}"#;
    assert!(Field::from_bytes(&file(&all, good), "field").unwrap().layout.history.is_empty());
    let found = refusal(&file(&["u", "v", "peak", "ratio", "su", "sv", "sw"], good));
    assert!(found.starts_with("field: channels peak, ratio, su, sv, sw, u, v without w, flag; wanted"), "{found}");
    let changes = [
        ("[4, 3, 2]", "[3, 4, 2]", "4 x 6 pixels for a shape of 3 x 4 x 2"),
        ("[4, 3, 2]", "[4, 3, 0]", "shape [4, 3, 0]"),
        ("[4, 3, 2]", "[4, 4294967296, 4294967296]", "shape [4, 4294967296, 4294967296]"),
        ("[1, 1, 1]", "[1, -1, 1]", "spacing_mm"),
        ("\"overlap\": 0", "\"overlap\": 2", "overlap 2"),
        ("\"overlap\": 0", "\"over\": 0", "missing field `overlap`"),
    ];
    for (from, to, message) in changes {
        let refusal = refusal(&file(&all, &good.replace(from, to)));
        assert!(refusal.starts_with("field: ") && refusal.contains(message), "{refusal}");
    }
}

#[test]
fn a_field_that_no_reader_takes_is_not_written() {
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
    assert!(refused.contains("the extension .vtk; wanted .exr, .vti or .csv"), "{refused}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    field().save(Path::new("/dev/null")).unwrap();
}

#[test]
fn a_csv_has_units_and_every_bit() {
    let field = field();
    let text = String::from_utf8(written(&field, "field.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next().unwrap(), "x_mm,y_mm,z_mm,u_mm,v_mm,w_mm,peak,ratio,su_mm,sv_mm,sw_mm,flag");
    for (i, line) in lines.enumerate() {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        assert_eq!(numbers.len(), 12);
        assert_eq!(numbers[..3], field.place_mm(i));
        assert_eq!((numbers[4] as f32, numbers[5] as f32), (field.v[i], field.w[i]));
        assert_eq!(numbers[11] as f32, field.flag[i]);
    }
    assert_eq!(text.lines().count(), 25);
    assert!(text.contains("NaN") && text.contains(",inf,"));
}

/// Reads the XML as a VTK reader does: offsets count from the byte behind the underscore, each array behind its length.
#[test]
fn a_vti_finds_its_arrays() {
    let field = field();
    let bytes = written(&field, "field.vti");
    let mark = b"<AppendedData encoding=\"raw\">\n_";
    let start = bytes.windows(mark.len()).position(|window| window == mark).unwrap() + mark.len();
    let xml = std::str::from_utf8(&bytes[..start]).unwrap();
    assert!(xml.contains(r#"WholeExtent="0 3 0 2 0 1" Origin="-1 2 0.125" Spacing="0.25 0.5 1""#), "{xml}");
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
            _ => assert_eq!(components, 1),
        }
        end += 8 + length;
        names.push(name);
    }
    assert_eq!(names, ["displacement_mm", "uncertainty_mm", "peak", "ratio", "flag"]);
    assert_eq!(&bytes[end..], b"\n</AppendedData>\n</VTKFile>\n");
}
