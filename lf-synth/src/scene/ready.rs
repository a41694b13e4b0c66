//! Ready scenes, as data.

use lf_core::{Refusal, frame};
use serde_json::{Map, Value, json};

/// Name, description and scene.
type ReadyScene = (&'static str, &'static str, fn() -> Value);

/// All ready scenes: name, description, and the other keys but the seed.
pub const READY: [ReadyScene; 13] = [
    (
        "demo",
        "a small volume of 60 x 60 lenslets at 0.5 particles each, round stop, a wide vortex ring that moves along x",
        demo,
    ),
    (
        "core",
        "20 x 20 lenslets at 0.1 particles each behind a square stop, at rest: the small test volume of section 3",
        || core("square", "square", 0.0),
    ),
    ("core-round", "the same behind a round stop", || core("circle", "square", 0.0)),
    ("core-hexagonal", "the same on a hexagonal lattice turned by 3 mrad", || core("square", "hexagonal", 0.003)),
    ("uniform", "40 x 40 lenslets at 0.5 particles each, all displaced by (0.02, -0.013, 0.06) mm", uniform),
    (
        "waves",
        "the volume of section 4, 1820 x 1820 x 182 voxels of 1 x 1 x 10 px, 0.5 particles a lenslet, Case A1 at 25 px",
        || moved(130, wave(), [1.0, 1.0, 10.0], [65, 65, 33]),
    ),
    (
        "full",
        "the size of section 5, 3300 x 2200 x 182 voxels of 2 x 2 x 10 px, 0.4 particles a lenslet, by the simulations' camera",
        full,
    ),
    (
        "experiment",
        "the experiment of section 5: 200 mm f/4 at 0.95, a jet in water behind 20 mm of Perspex, a 10 mm sheet, noise",
        experiment,
    ),
    ("tank", "a corner of it: the same camera, water, sheet and noise on 60 x 60 lenslets, a vortex ring", || {
        in_water([78 * 14, 78 * 14], [2.4, 2.4, 7.9], ring(0.0, 1.2, 0.1), [41, 41, 65])
    }),
    ("jet", "a round jet with two vortex rings in its shear layer, 60 x 60 lenslets at 0.5 particles each", || {
        let flow = json!([jet(2.4, 0.06), ring(-1.1, 1.2, 0.04), ring(1.1, 1.3, 0.03)]);
        moved(60, flow, [2.0, 2.0, 10.0], [41, 41, 65])
    }),
    ("ring", "a vortex ring that moves along x, 60 x 60 lenslets at 0.5 particles each", || {
        moved(60, ring(0.0, 1.2, 0.1), [2.0, 2.0, 10.0], [41, 41, 65])
    }),
    (
        "doublets",
        "two cemented doublets about a stop at f/4, m = 1, traced by their surfaces: 60 x 60 lenslets, a vortex ring, dots",
        doublets,
    ),
    ("target", "a target of dots 1.1 mm apart at seven depths on 120 x 120 lenslets, for calibration", target),
];

/// The ready scene of this name. None if there is no such scene.
pub fn scene(name: &str) -> Option<Value> {
    let (_, about, keys) = READY.iter().find(|ready| ready.0 == name)?;
    let Value::Object(keys) = keys() else { unreachable!("a scene is an object") };
    let mut scene = Map::from_iter([("about".to_string(), (*about).into())]);
    scene.insert(frame::KEY.to_string(), frame::MARK.into());
    scene.extend(keys);
    scene.insert("seed".to_string(), 1.into());
    Some(Value::Object(scene))
}

/// The camera of the simulations. The paper's table of parameters is lost; these values follow from its text or agree
/// with it: pixels of 5.5 um, lenslets of 77 um (14 px) and 0.308 mm focal length, which match N_w = 4, and a 200 mm
/// lens at m = 1.
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

fn volume([x, y, z]: [f64; 3]) -> Value {
    json!({"x_mm": [-x, x], "y_mm": [-y, y], "z_mm": [-z, z]})
}

/// The bounds of `lenslets` lenslets of 14 px at m = 1, and 10 mm of depth, which 182 slices of 10 px fill.
fn volume_of_lenslets(lenslets: u32) -> Value {
    let half_mm = f64::from(lenslets * 7) * 0.0055;
    volume([half_mm, half_mm, 5.0])
}

fn wave() -> Value {
    json!({"kind": "wave", "case": "A1", "omega": 0.25, "amplitude_px": 25.0})
}

/// A vortex ring about the x axis.
fn ring(x_mm: f64, radius_mm: f64, displacement_mm: f64) -> Value {
    json!({
        "kind": "ring", "centre_mm": [x_mm, 0.0, 0.0], "axis": [1.0, 0.0, 0.0], "radius_mm": radius_mm,
        "core_mm": 0.3 * radius_mm, "displacement_mm": displacement_mm
    })
}

/// A jet along the x axis.
fn jet(diameter_mm: f64, displacement_mm: f64) -> Value {
    json!({
        "kind": "jet", "centre_mm": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0], "diameter_mm": diameter_mm,
        "shear_layer_mm": 0.05 * diameter_mm, "displacement_mm": displacement_mm
    })
}

/// Light from the ends of the depth fans out over 8.2 lenslets to each side, so sensors are 18 lenslets wider than
/// volumes.
fn core(aperture: &str, layout: &str, rotation_rad: f64) -> Value {
    json!({
        "camera": camera(38, aperture, layout, rotation_rad),
        "volume": volume_of_lenslets(20),
        "particles": {"per_lenslet": 0.1, "sigma_px": 0.75, "intensity": 100000.0, "rays": 200_000},
        "frames": 1,
        "truth": {"pixels_per_voxel": [1.0, 1.0, 10.0], "sigma_vox": 0.75, "vectors": [9, 9, 9]}
    })
}

/// `lenslets` x `lenslets` lenslets behind a round stop, with a flow.
fn moved(lenslets: u32, flow: Value, pixels_per_voxel: [f64; 3], vectors: [usize; 3]) -> Value {
    json!({
        "camera": camera(lenslets + 18, "circle", "square", 0.0),
        "volume": volume_of_lenslets(lenslets),
        "particles": {"per_lenslet": 0.5, "sigma_px": 0.75, "intensity": 100000.0},
        "flow": flow,
        "frames": 2,
        "truth": {"pixels_per_voxel": pixels_per_voxel, "sigma_vox": 0.75, "vectors": vectors}
    })
}

/// The ring's core is nearly as wide as a window of 0.88 mm.
fn demo() -> Value {
    let mut scene = moved(60, ring(0.0, 1.4, 0.1), [2.0, 2.0, 10.0], [41, 41, 65]);
    scene["flow"]["core_mm"] = 0.7.into();
    scene["particles"]["sigma_px"] = 1.0.into();
    scene["particles"]["rays"] = 50_000.into();
    scene["white"] = json!({"counts": 1000.0, "rays_per_lenslet": 20_000});
    scene
}

fn uniform() -> Value {
    let flow = json!({"kind": "uniform", "displacement_mm": [0.02, -0.013, 0.06]});
    let mut scene = moved(40, flow, [1.0, 1.0, 10.0], [9, 9, 9]);
    scene["camera"]["main_lens"]["aperture"] = "square".into();
    scene["particles"]["rays"] = 50_000.into();
    scene
}

/// 471 x 314 lenslets on 6600 x 4400 px, and 182 slices of 10 px.
fn full() -> Value {
    let mut scene = moved(1, wave(), [2.0, 2.0, 10.0], [83, 55, 23]);
    scene["camera"]["sensor"] = json!({"width": 6600, "height": 4400, "pixel_pitch_mm": 0.0055});
    scene["volume"] = volume([18.15, 12.1, 5.005]);
    scene["particles"]["per_lenslet"] = 0.4.into();
    scene
}

/// The camera is that of the paper's section 5: a 200 mm lens at f/4 and M = -0.95. Its working f-number is 7.8;
/// lenslets of 0.6 mm focal length match it. The paper gives the tank (360 mm across, 20 mm of Perspex) but not its
/// place. We assume that its middle is in focus. The particles differ in size and brightness. The sensor has 12 bits
/// and a full well of 20,000 electrons, as specified for the paper's camera.
fn in_water([width, height]: [u32; 2], half_mm: [f64; 3], flow: Value, vectors: [usize; 3]) -> Value {
    let mut camera = camera(1, "circle", "square", 0.0);
    camera["sensor"] = json!({"width": width, "height": height, "pixel_pitch_mm": 0.0055});
    camera["main_lens"]["magnification"] = 0.95.into();
    camera["main_lens"]["working_f_number"] = 7.8.into();
    camera["microlenses"]["focal_length_mm"] = 0.6.into();
    camera["medium"] = json!({"index": 1.333, "window_z_mm": 180.0, "window_thickness_mm": 20.0, "window_index": 1.49});
    json!({
        "camera": camera,
        "volume": volume(half_mm),
        "particles": {
            "per_lenslet": 0.6, "sigma_px": 0.9, "size_spread": 0.2, "intensity": 60000.0, "intensity_spread": 0.3
        },
        "light": {"profile": "gaussian", "centre_mm": 0.0, "thickness_mm": 10.0},
        "flow": flow,
        "frames": 2,
        "sensor_noise": {
            "gain_counts_per_electron": 0.2, "photon_noise": true, "full_well_electrons": 20000.0,
            "read_noise_electrons": 12.0, "dark_counts": 40.0, "bits": 12
        },
        "truth": {"pixels_per_voxel": [2.0, 2.0, 10.0], "sigma_vox": 0.75, "vectors": vectors}
    })
}

/// At most 60 px (0.347 mm) between frames. The jet is 20 mm wide; the rings lie where its shear layer rolls up.
fn experiment() -> Value {
    let flow = json!([jet(20.0, 0.2), ring(-9.0, 10.0, 0.12), ring(9.0, 11.0, 0.1)]);
    in_water([6600, 4400], [19.1, 12.74, 7.9], flow, [83, 55, 35])
}

/// Two achromats of 200 mm, of crown and flint glass, back to back about the stop: a relay whose coma and distortion
/// cancel at m = 1. For these radii rays on the axis miss least at f/4. There, spherical aberration of third order is
/// about as large as that of fifth order.
fn doublets() -> Value {
    let surface = |radius_mm: f64, index: f64, next_mm: f64| {
        let mut surface = json!({"radius_mm": radius_mm, "half_diameter_mm": 28.0});
        (surface["index"], surface["next_mm"]) = (index.into(), next_mm.into());
        surface
    };
    let mut scene = moved(60, ring(0.0, 1.2, 0.1), [2.0, 2.0, 10.0], [41, 41, 65]);
    scene["thick_lens"] = json!({
        "surfaces": [
            surface(731.6, 1.62, 6.0), surface(83.8, 1.5168, 14.0), surface(-96.0, 1.0, 30.0),
            surface(96.0, 1.5168, 14.0), surface(-83.8, 1.62, 6.0), surface(-731.6, 1.0, 0.0)
        ],
        "stop_after": 3, "stop_distance_mm": 15.0
    });
    scene["dots"] = target()["dots"].clone();
    scene["dots"]["spacing_mm"] = 0.6.into();
    scene
}

fn target() -> Value {
    json!({
        "camera": camera(120, "circle", "square", 0.0),
        "volume": volume_of_lenslets(102),
        "particles": {"count": 0, "sigma_px": 1.0},
        "frames": 1,
        "dots": {
            "spacing_mm": 1.1, "diameter_mm": 0.05, "depths_mm": [-4.0, -2.7, -1.3, 0.0, 1.3, 2.7, 4.0],
            "intensity": 500000.0
        }
    })
}

/// Sets a key of a scene, such as `particles.per_lenslet=0.5`. The value is JSON, or a string if it is not valid JSON;
/// null removes the key. Refuses an assignment that is not KEY=VALUE, or has no place in the scene.
pub fn set(scene: &mut Value, assignment: &str) -> Result<(), Refusal> {
    let refused = |found: String| Refusal::new(found, "wanted KEY=VALUE");
    let (key, text) = assignment.split_once('=').ok_or_else(|| refused(format!("'{assignment}' has no '='")))?;
    let value = serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_string()));
    let no_key = || refused(format!("'{key}' is not a key of a scene"));
    let mut names = key.split('.').peekable();
    let mut place = scene;
    while let Some(name) = names.next() {
        let object = place.as_object_mut().filter(|_| !name.is_empty()).ok_or_else(no_key)?;
        if names.peek().is_none() && value.is_null() {
            object.shift_remove(name);
            return Ok(());
        }
        place = object.entry(name).or_insert_with(|| json!({}));
    }
    *place = value;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ready_scene_is_a_scene() {
        for (name, ..) in READY {
            let scene: crate::Scene = serde_json::from_value(scene(name).unwrap()).unwrap();
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
