//! Ready scenes.

use serde_json::{Value, json};

/// A ready scene's name and what it stands for.
pub const NAMES: [(&str, &str); 5] = [
    ("demo", "a small volume of 60 x 60 lenslets at 0.5 particles each, round stop, moved by the paper's Case A1"),
    (
        "core",
        "20 x 20 lenslets at 0.1 particles each behind a square stop, at rest: the small test volume of section 3",
    ),
    ("core-round", "the same behind a round stop"),
    ("core-hexagonal", "the same on a hexagonal lattice turned by 3 mrad"),
    ("uniform", "40 x 40 lenslets at 0.5 particles each, all displaced by (0.02, -0.013, 0.06) mm"),
];

/// The paper's table of simulation parameters did not survive in its text. These follow from it or match it: 5.5 um
/// pixels, 77 um lenslets of 14 px, f-numbers matched at N_w = 4 by 0.308 mm lenslets, m = 1 with a 200 mm lens.
fn camera(lenslets: u32, aperture: &str, layout: &str, rotation_rad: f64) -> Value {
    json!({
        "sensor": {"width": 14 * lenslets, "height": 14 * lenslets, "pixel_pitch_mm": 0.0055},
        "main_lens": {"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0, "aperture": aperture},
        "microlenses": {
            "layout": layout, "pitch_mm": 0.077, "focal_length_mm": 0.308,
            "rotation_rad": rotation_rad, "offset_mm": [0.0, 0.0]
        }
    })
}

/// Bounds of so many lenslets of 14 px at m = 1, and the 10 mm that 182 slices of 10 px fill.
fn volume(lenslets: u32) -> Value {
    let half = f64::from(lenslets * 7) * 0.0055;
    json!({"x_mm": [-half, half], "y_mm": [-half, half], "z_mm": [-5.0, 5.0]})
}

/// A ready scene.
pub fn scene(name: &str) -> Option<Value> {
    let (_, about) = NAMES.iter().find(|(known, _)| *known == name)?;
    // Light from the ends of the depth fans out over 8.2 lenslets to each side: sensors are 18 lenslets wider.
    let core = |aperture, layout, rotation_rad| {
        json!({
            "about": about,
            "camera": camera(38, aperture, layout, rotation_rad),
            "volume": volume(20),
            "particles": {"per_lenslet": 0.1, "sigma_px": 0.75, "intensity": 100000.0, "rays": 200_000},
            "frames": 1,
            "truth": {"pixels_per_voxel": [1.0, 1.0, 10.0], "sigma_vox": 0.75, "vectors": [9, 9, 9]},
            "seed": 1
        })
    };
    Some(match name {
        "demo" => json!({
            "about": about,
            "camera": camera(78, "circle", "square", 0.0),
            "volume": volume(60),
            "particles": {"per_lenslet": 0.5, "sigma_px": 1.0, "intensity": 100000.0, "rays": 50_000},
            "flow": {"kind": "wave", "case": "A1", "omega": 0.25, "amplitude_px": 25.0},
            "frames": 2,
            "truth": {"pixels_per_voxel": [2.0, 2.0, 10.0], "sigma_vox": 0.75, "vectors": [33, 33, 17]},
            "white": {"counts": 1000.0, "rays_per_lenslet": 20_000},
            "seed": 1
        }),
        "core" => core("square", "square", 0.0),
        "core-round" => core("circle", "square", 0.0),
        "core-hexagonal" => core("square", "hexagonal", 0.003),
        "uniform" => json!({
            "about": about,
            "camera": camera(58, "square", "square", 0.0),
            "volume": volume(40),
            "particles": {"per_lenslet": 0.5, "sigma_px": 0.75, "intensity": 100000.0, "rays": 50_000},
            "flow": {"kind": "uniform", "displacement_mm": [0.02, -0.013, 0.06]},
            "frames": 2,
            "truth": {"pixels_per_voxel": [1.0, 1.0, 10.0], "sigma_vox": 0.75, "vectors": [9, 9, 9]},
            "seed": 1
        }),
        _ => return None,
    })
}

/// Sets a key of a scene, `particles.per_lenslet=0.5`; the value is JSON, or a string where it is not.
///
/// # Errors
/// Says what is wrong with the words.
pub fn set(scene: &mut Value, words: &str) -> Result<(), String> {
    let (key, text) = words.split_once('=').ok_or_else(|| format!("'{words}' has no '='"))?;
    let value = serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_string()));
    let mut place = scene;
    for part in key.split('.') {
        if part.is_empty() || !place.is_object() {
            return Err(format!("'{key}' is not a key of a scene"));
        }
        place = &mut place[part];
        if place.is_null() {
            *place = json!({});
        }
    }
    *place = value;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ready_scene_is_a_scene() {
        for (name, _) in NAMES {
            let value = scene(name).unwrap();
            let scene: crate::Scene = serde_json::from_value(value).unwrap();
            assert!(scene.about.is_some());
        }
        assert!(scene("nothing").is_none());
    }

    #[test]
    fn keys_are_set_by_path() {
        let mut value = scene("core").unwrap();
        set(&mut value, "particles.per_lenslet=0.5").unwrap();
        set(&mut value, "camera.main_lens.aperture=circle").unwrap();
        assert_eq!(value["particles"]["per_lenslet"], 0.5);
        assert_eq!(value["camera"]["main_lens"]["aperture"], "circle");
        assert!(set(&mut value, "seed").is_err());
        assert!(set(&mut value, "seed.x=1").is_err());
    }
}
