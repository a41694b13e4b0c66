//! Small inputs that the tools accept, and damaged ones that they must refuse.

use crate::folder::Folder;
use lf_core::{Camera, Field, Grid, History, VectorGrid, field::MEASURED, volume};
use ndarray::Array2;
use std::fs;
use std::ops::Deref;
use std::path::{Path, PathBuf};

/// Sides of the sample sensor, px.
pub const SENSOR_PX: usize = 140;

const PITCH_PX: usize = 14;

/// The kind of file that an argument names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `camera.json`.
    Camera,
    /// `scene.json`.
    Scene,
    /// A light-field image.
    Image,
    /// A white image.
    White,
    /// A `.lfv` of voxels to reconstruct.
    Support,
    /// A `.lfv` of light.
    Volume,
    /// The light of `Volume`, moved by one voxel.
    Moved,
    /// A `.lfv` of the light of six particles.
    Few,
    /// A vector field.
    Field,
}

impl Kind {
    /// Name of its sample.
    pub fn file(self) -> &'static str {
        match self {
            Self::Camera => "camera.json",
            Self::Scene => "scene.json",
            Self::Image => "image.exr",
            Self::White => "white.exr",
            Self::Support => "support.lfv",
            Self::Volume => "volume.lfv",
            Self::Moved => "moved.lfv",
            Self::Few => "few.lfv",
            Self::Field => "field.exr",
        }
    }

    /// A kind of another format, which a tool that wants this kind must refuse.
    pub fn stranger(self) -> Self {
        match self {
            Self::Image | Self::White | Self::Field | Self::Camera | Self::Scene => Self::Volume,
            Self::Support | Self::Volume | Self::Moved | Self::Few => Self::Image,
        }
    }
}

/// A way to spoil an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damage {
    /// The file is missing.
    Missing,
    /// It is a folder.
    Folder,
    /// It has no bytes.
    Empty,
    /// It is meaningless text.
    Text,
    /// It is random bytes.
    Noise,
    /// It is a good file of another format.
    Stranger,
    /// Only its first seven bytes are left.
    Stub,
    /// Its second half is lost.
    Half,
    /// Its last byte is lost.
    LastByte,
}

/// Every damage.
pub const DAMAGES: [Damage; 9] = [
    Damage::Missing,
    Damage::Folder,
    Damage::Empty,
    Damage::Text,
    Damage::Noise,
    Damage::Stranger,
    Damage::Stub,
    Damage::Half,
    Damage::LastByte,
];

/// A folder with one sound file of each kind.
#[derive(Debug)]
pub struct Samples(Folder);

impl Deref for Samples {
    type Target = Folder;

    fn deref(&self) -> &Folder {
        &self.0
    }
}

impl Samples {
    /// Writes the samples.
    pub fn new() -> Self {
        let samples = Self(Folder::new());
        let camera = camera();
        samples.write(Kind::Camera.file(), camera.to_json().trim_end());
        samples.write(Kind::Scene.file(), scene(&camera));
        samples.frame(Kind::Image.file(), speckle);
        samples.frame(Kind::White.file(), white);
        samples.write(Kind::Support.file(), support());
        samples.write(Kind::Volume.file(), light(0));
        samples.write(Kind::Moved.file(), light(1));
        samples.write(Kind::Few.file(), few());
        field().save(&samples.path(Kind::Field.file())).expect("a sample is written");
        samples
    }

    /// Path of a sound sample.
    pub fn sound(&self, kind: Kind) -> PathBuf {
        self.path(kind.file())
    }

    /// Writes an image of the sensor's size, `value` at each (column, row).
    pub fn frame(&self, name: &str, value: impl Fn(usize, usize) -> f32) -> PathBuf {
        self.image(name, &Array2::from_shape_fn((SENSOR_PX, SENSOR_PX), |(y, x)| value(x, y)))
    }

    /// A spoilt sample of a kind, under the name `bad-...`.
    pub fn spoilt(&self, kind: Kind, damage: Damage) -> PathBuf {
        let name = format!("bad-{}-{}", format!("{damage:?}").to_lowercase(), kind.file());
        let sound = self.bytes(kind.file());
        let bytes = match damage {
            Damage::Missing => return self.path(&name),
            Damage::Folder => {
                fs::create_dir_all(self.path(&name)).expect("a folder of the test");
                return self.path(&name);
            }
            Damage::Empty => Vec::new(),
            Damage::Text => b"hello world, this is no data\n".to_vec(),
            Damage::Noise => (0..4096u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8).collect(),
            Damage::Stranger => self.bytes(kind.stranger().file()),
            Damage::Stub => sound[..7].to_vec(),
            Damage::Half => sound[..sound.len() / 2].to_vec(),
            Damage::LastByte => sound[..sound.len() - 1].to_vec(),
        };
        self.write(&name, bytes)
    }

    /// Sorted names of all files and folders in the folder, at any depth.
    pub fn listing(&self) -> Vec<String> {
        fn collect(folder: &Path, names: &mut Vec<String>) {
            for entry in fs::read_dir(folder).expect("a folder of the test") {
                let path = entry.expect("an entry").path();
                names.push(path.display().to_string());
                if path.is_dir() {
                    collect(&path, names);
                }
            }
        }
        let mut names = Vec::new();
        collect(self.root(), &mut names);
        names.sort();
        names
    }
}

impl Default for Samples {
    fn default() -> Self {
        Self::new()
    }
}

fn camera() -> Camera {
    Camera::from_json(
        r#"{"sensor": {"width": 140, "height": 140, "pixel_pitch_mm": 0.0055},
            "main_lens": {"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0,
                          "aperture": "square"},
            "microlenses": {"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308,
                            "rotation_rad": 0.0, "offset_mm": [0.0, 0.0]}}"#,
    )
    .expect("a camera")
}

fn scene(camera: &Camera) -> String {
    serde_json::json!({
        "frame": "right-handed",
        "camera": camera,
        "volume": {"x_mm": [-0.2, 0.2], "y_mm": [-0.2, 0.2], "z_mm": [-0.3, 0.3]},
        "particles": {"count": 5, "sigma_px": 0.75, "rays": 500},
        "white": {"counts": 1000.0, "rays_per_lenslet": 500},
        "frames": 1,
        "seed": 7,
    })
    .to_string()
}

/// Speckle under four of five lenslets and darkness under the fifth, so that pruning keeps some voxels.
fn speckle(x: usize, y: usize) -> f32 {
    let lenslet = x / PITCH_PX + 7 * (y / PITCH_PX);
    if lenslet % 5 == 3 { 0.0 } else { 100.0 + ((x * 7919 + y * 104_729) % 101) as f32 }
}

/// Lenslet images: brightest in the middle of each pitch, dark between.
fn white(x: usize, y: usize) -> f32 {
    let across = |n: usize| (std::f64::consts::PI * (n as f64 + 0.5) / PITCH_PX as f64).sin().abs();
    (1000.0 * across(x) * across(y)) as f32
}

fn lfv(grid: &Grid, indices: &[u64], column: &str, values: &[f32]) -> Vec<u8> {
    let mut bytes = Vec::new();
    volume::write(&mut bytes, grid, indices, &[(column, values)], &History::new()).expect("memory is writable");
    bytes
}

fn support() -> Vec<u8> {
    let grid = Grid { shape: [36, 36, 8], spacing_mm: [0.0055, 0.0055, 0.055], origin_mm: [-0.096, -0.096, -0.19] };
    let indices: Vec<u64> = (0..grid.len()).filter(|index| index % 3 == 0).collect();
    lfv(&grid, &indices, "score", &vec![1.0; indices.len()])
}

fn light(shift_vox: u64) -> Vec<u8> {
    let grid = Grid { shape: [48, 48, 24], spacing_mm: [0.0055, 0.0055, 0.055], origin_mm: [-0.13, -0.13, -0.63] };
    let is_lit = |index: u64| index * index % 97 == 3 || index % 89 == 5;
    let indices: Vec<u64> = (shift_vox..grid.len()).filter(|index| is_lit(index - shift_vox)).collect();
    let values: Vec<f32> = indices.iter().map(|index| ((index - shift_vox) % 13) as f32 + 1.0).collect();
    lfv(&grid, &indices, "intensity", &values)
}

fn few() -> Vec<u8> {
    let grid = Grid { shape: [48, 48, 24], spacing_mm: [0.0055, 0.0055, 0.055], origin_mm: [-0.13, -0.13, -0.63] };
    let indices: Vec<u64> = (0..grid.len()).filter(|index| index % 9973 == 4000).collect();
    lfv(&grid, &indices, "intensity", &vec![1.0; indices.len()])
}

fn field() -> Field {
    let mut field = Field::empty(VectorGrid {
        shape: [4, 3, 7],
        spacing_mm: [0.1, 0.1, 0.2],
        origin_mm: [-0.15, -0.1, -0.6],
        voxel_mm: [0.0055, 0.0055, 0.055],
        window: [16, 16, 8],
        overlap: 0.5,
        dt_s: None,
        history: History::new(),
    });
    for i in 0..field.len() {
        (field.flag[i], field.u[i]) = (MEASURED, i as f32 * 1e-3);
    }
    field
}
