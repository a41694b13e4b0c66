//! The tool in a folder, and the inputs that several tests write.

use lf_core::{Field, VectorGrid, field::MEASURED};
use lf_tests::Workbench;
use std::path::PathBuf;

/// A camera whose pixel is 0.011 mm in focus.
pub const CAMERA: &str = r#"{
    "sensor": {"width": 280, "height": 280, "pixel_pitch_mm": 0.0055},
    "main_lens": {"focal_length_mm": 200.0, "magnification": 0.5, "working_f_number": 4.0, "aperture": "circle"},
    "microlenses": {"layout": "hexagonal", "pitch_mm": 0.077, "focal_length_mm": 0.231, "rotation_rad": 0.003,
                    "offset_mm": [0.0, 0.0]}
}"#;

/// The tool in an empty folder.
pub fn workbench() -> Workbench {
    Workbench::new(env!("CARGO_BIN_EXE_lf-validate"))
}

/// A field of measured vectors on places 0.5 mm apart.
pub fn field(shape: [usize; 3], vector: impl Fn([f64; 3]) -> [f32; 3]) -> Field {
    let mut field = Field::empty(VectorGrid {
        shape,
        spacing_mm: [0.5; 3],
        origin_mm: [0.0; 3],
        voxel_mm: [0.01, 0.01, 0.1],
        window: [32, 32, 16],
        overlap: 0.75,
        dt_s: None,
        history: Vec::new(),
    });
    field.flag.fill(MEASURED);
    for at in 0..field.len() {
        [field.u[at], field.v[at], field.w[at]] = vector(field.place_mm(at));
    }
    field
}

/// Writes a field and returns its path.
pub fn save_field(bench: &Workbench, name: &str, field: &Field) -> PathBuf {
    field.save(&bench.path(name)).unwrap();
    bench.path(name)
}
