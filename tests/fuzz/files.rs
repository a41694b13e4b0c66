//! Sound files of each kind, and changes that keep what a reader checks first: checksums and lengths.

use super::{bytes, json, random::Random};
use lf_core::{Camera, Field, Grid, VectorGrid, field::MEASURED, image, volume};
use lf_synth::scene::ready;
use ndarray::Array2;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

fn saved(name: &str, save: impl FnOnce(&Path)) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    save(&path);
    fs::read(path).expect("a file that was saved")
}

pub fn volumes() -> Vec<Vec<u8>> {
    let grid = Grid { shape: [6, 5, 4], spacing_mm: [0.01, 0.01, 0.1], origin_mm: [0.0; 3] };
    let extra = json!({"tile": {"index": 1, "of": 2, "halo_mm": 0.1, "core_vox": [[0, 3], [0, 5]],
        "pixels": [[0, 9], [0, 9]]}});
    let written = |indices: &[u64], extra: &Value| {
        let (mut bytes, values) = (Vec::new(), vec![1.5; indices.len()]);
        let columns = [("intensity", values.as_slice()), ("score", values.as_slice())];
        let extra = extra.as_object().expect("an object");
        volume::write_with(&mut bytes, &grid, indices, &columns, &Vec::new(), extra).expect("memory is writable");
        bytes
    };
    vec![
        written(&[0, 3, 17, 119], &json!({})),
        written(&(0..120).collect::<Vec<u64>>(), &extra),
        written(&[], &json!({})),
    ]
}

/// Changes the header as JSON or the body as bytes, and mends padding and checksum most of the time.
pub fn change_volume(sound: &[u8], others: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    const PREFIX: usize = 16;
    if random.below(5) == 0 {
        return bytes::change(sound, others, random);
    }
    let length = u32::from_le_bytes(sound[12..PREFIX].try_into().expect("four bytes")) as usize;
    let (text, mut body) = (&sound[PREFIX..PREFIX + length], sound[PREFIX + length..].to_vec());
    let mut header: Value = serde_json::from_slice(text.trim_ascii_end()).expect("a header");
    if random.below(2) == 0 {
        json::change_value(&mut header, random);
    } else {
        body = bytes::change(&body, others, random);
    }
    if random.below(8) > 0
        && let Some(map) = header.as_object_mut().filter(|map| map.contains_key("checksum"))
    {
        map["checksum"] = format!("{:016x}", xxhash_rust::xxh3::xxh3_64(&body)).into();
    }
    let mut text = header.to_string().into_bytes();
    text.resize((PREFIX + text.len()).next_multiple_of(64) - PREFIX, b' ');
    [&sound[..12], &(text.len() as u32).to_le_bytes(), &text, &body].concat()
}

pub fn fields() -> Vec<Vec<u8>> {
    let field = |shape: [usize; 3], dt_s: Option<f64>| {
        let layout = VectorGrid {
            shape,
            spacing_mm: [0.1, 0.1, 0.2],
            origin_mm: [-0.15, -0.1, -0.6],
            voxel_mm: [0.0055, 0.0055, 0.055],
            window: [16, 16, 8],
            overlap: 0.5,
            dt_s,
            history: Vec::new(),
        };
        let mut field = Field::empty(layout);
        field.flag.fill(MEASURED);
        field.u.iter_mut().zip(0..).for_each(|(u, n)| *u = n as f32 * 1e-3);
        saved("field.exr", |path| field.save(path).expect("a field"))
    };
    vec![field([4, 3, 7], None), field([1, 1, 1], Some(1e-3))]
}

fn camera() -> Value {
    let mut camera = ready::scene("core").expect("a ready scene")["camera"].take();
    (camera["sensor"]["width"], camera["sensor"]["height"]) = (json!(140), json!(126));
    camera
}

pub fn cameras() -> Vec<Vec<u8>> {
    let blocks = json!({
        "medium": {"index": 1.33, "window_z_mm": 20.0, "window_thickness_mm": 5.0, "window_index": 1.5},
        "tilt": {"x_rad": 0.002, "y_rad": -0.001},
        "distortion": {"radial": [1e-5, 1e-8], "tangential": [1e-6, 1e-6]},
    });
    let with = |names: &[&str], layout: &str| {
        let mut camera = camera();
        camera["microlenses"]["layout"] = layout.into();
        names.iter().for_each(|name| camera[*name] = blocks[*name].clone());
        (camera["main_lens"]["pupil_distance_mm"], camera["microlenses"]["gap_mm"]) = (json!(350.0), json!(0.31));
        camera.to_string().into_bytes()
    };
    let all = vec![
        camera().to_string().into_bytes(),
        with(&[], "hexagonal"),
        with(&["medium"], "square"),
        with(&["tilt", "distortion"], "square"),
    ];
    let is_sound = |bytes: &Vec<u8>| Camera::from_json(str::from_utf8(bytes).expect("a text")).is_ok();
    all.into_iter().filter(is_sound).collect()
}

pub fn scenes() -> Vec<Vec<u8>> {
    let noise = json!({"gain_counts_per_electron": 0.2, "photon_noise": true, "read_noise_electrons": 12, "bits": 12});
    let scene = |name: &str, keys: &[(&str, Value)]| {
        let mut scene = ready::scene(name).expect("a ready scene");
        scene["camera"] = camera();
        scene["volume"] = json!({"x_mm": [-0.2, 0.2], "y_mm": [-0.2, 0.2], "z_mm": [-0.3, 0.3]});
        scene["particles"] = json!({"count": 4, "sigma_px": 0.75, "rays": 300});
        keys.iter().for_each(|(key, value)| scene[*key] = value.clone());
        scene.to_string().into_bytes()
    };
    vec![
        scene("core", &[]),
        scene(
            "demo",
            &[
                ("sensor_noise", noise),
                ("light", json!({"profile": "gaussian", "thickness_mm": 0.2, "centre_mm": 0.0})),
            ],
        ),
        scene("core-round", &[("diffraction", json!({"wavelength_mm": 5.32e-4}))]),
    ]
}

pub fn particles() -> Vec<Vec<u8>> {
    let text = "# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n0,0,0.1,0.2,0.3,100\n0,1,-0.1,0,0.3,5e3\n1,0,0.2,0.2,0.3,100\n1,1,0,0,0,1\n";
    vec![text.into(), text.replace('\n', "\r\n").into()]
}

fn pixels() -> Array2<f32> {
    Array2::from_shape_fn((9, 13), |(y, x)| ((x * 31 + y * 17) % 101) as f32)
}

pub fn tiffs() -> Vec<Vec<u8>> {
    vec![saved("image.tif", |path| image::save(path, &pixels(), &Vec::new()).expect("an image"))]
}

pub fn exrs() -> Vec<Vec<u8>> {
    let history = vec![lf_core::history::Step { tool: "a".into(), version: "1".into(), arguments: vec!["b".into()] }];
    let with = |history| saved("image.exr", |path| image::save(path, &pixels(), history).expect("an image"));
    vec![with(&Vec::new()), with(&history)]
}

/// The sum that ends a chunk of a PNG (ISO 3309).
fn chunk_sum(bytes: &[u8]) -> u32 {
    let step = |sum: u32, byte: &u8| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| if sum & 1 == 1 { 0xedb8_8320 ^ (sum >> 1) } else { sum >> 1 })
    };
    !bytes.iter().fold(!0, step)
}

fn chunk(name: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let named = [&name[..], data].concat();
    [&(data.len() as u32).to_be_bytes()[..], &named, &chunk_sum(&named).to_be_bytes()].concat()
}

const PNG: &[u8] = &[0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a];

pub fn pngs() -> Vec<Vec<u8>> {
    // Rows that are stored as they are: a byte for the filter, then two pixels.
    let rows = |bytes: usize| {
        (0..4u8).flat_map(|filter| [vec![filter], vec![10 * filter + 7; 2 * bytes]].concat()).collect::<Vec<u8>>()
    };
    let png = |depth: u8| {
        let data = rows(usize::from(depth) / 8);
        let length = data.len() as u16;
        let (a, b) = data.iter().fold((1u32, 0u32), |(a, b), byte| {
            let a = (a + u32::from(*byte)) % 65_521;
            (a, (a + b) % 65_521)
        });
        let stored =
            [&[0x78, 1, 1][..], &length.to_le_bytes(), &(!length).to_le_bytes(), &data, &(b << 16 | a).to_be_bytes()];
        let head = [&2u32.to_be_bytes()[..], &4u32.to_be_bytes(), &[depth, 0, 0, 0, 0]].concat();
        [PNG, &chunk(b"IHDR", &head), &chunk(b"IDAT", &stored.concat()), &chunk(b"IEND", &[])].concat()
    };
    [8, 16].map(png).to_vec()
}

/// Changes a PNG and mends the sums of its chunks most of the time.
pub fn change_png(sound: &[u8], others: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes::change(sound, others, random);
    let mut at = PNG.len();
    while random.below(20) > 0 && bytes.len() >= at + 12 {
        let length = u32::from_be_bytes(bytes[at..at + 4].try_into().expect("four bytes")) as usize;
        let Some(end) = at.checked_add(8 + length).filter(|end| end + 4 <= bytes.len()) else { break };
        let sum = chunk_sum(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
    bytes
}

pub fn texts() -> Vec<Vec<u8>> {
    let vti = r#"<?xml version="1.0"?><VTKFile type="ImageData"><ImageData WholeExtent="0 3 0 2 0 6" Origin="0 0 0" Spacing="1 1 1"><Piece Extent="0 3 0 2 0 6"><PointData><DataArray type="Float32" Name="u" format="ascii">1 2 3</DataArray></PointData></Piece></ImageData></VTKFile>"#;
    vec![
        vti.into(),
        "i,j,x_px,y_px\n0,0,1.5,2.5\n1,0,15.5,2.5\n".into(),
        "x_mm,y_mm,z_mm,u_mm\n0,0,0,1\n1,0,0,2\n".into(),
        "<svg width=\"10\" height=\"20\"><title>a</title></svg>".into(),
        "{\"q\": 0.5, \"by_depth\": {\"q\": [1, null]}}".into(),
        "{\"name\": \"a\", \"seconds\": 1.5}\n{\"name\": \"b\", \"seconds\": null}\n".into(),
    ]
}
