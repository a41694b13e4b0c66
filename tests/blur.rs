//! The blur that lf-calib reads from the rims of lenslet images, on white images whose blur is known.

use lf_core::Camera;
use lf_core::camera::GREEN_NM;
use lf_tests::{Call, Folder};

/// Sensor of 12 bits: 0.4 counts for an electron, read noise of 5 electrons.
const SENSOR: &str = "sensor_noise={\"gain_counts_per_electron\": 0.4, \"photon_noise\": true, \
    \"read_noise_electrons\": 5.0, \"bits\": 12}";

/// A folder with a white image of a camera with this blur, `white.exr`, and a nominal camera that names none.
fn white(layout: &str, stop: &str, f_number: f64, blur: &str) -> Folder {
    let folder = Folder::new();
    let sets = [
        format!("camera.microlenses.layout={layout}"),
        format!("camera.main_lens.aperture={stop}"),
        format!("camera.main_lens.working_f_number={f_number}"),
        "camera.microlenses.rotation_rad=0.003".to_string(),
        "white={\"counts\": 2000, \"rays_per_lenslet\": 10000}".to_string(),
        SENSOR.to_string(),
    ];
    let scene = |more: &[String]| {
        let set = sets.iter().chain(more).flat_map(|key| ["--set", key]);
        Call::new("lf-synth").words(["scene", "core"]).words(set).run().done().stdout
    };
    let nominal: serde_json::Value = serde_json::from_slice(&scene(&[])).unwrap();
    folder.write("nominal.json", nominal["camera"].to_string());
    folder.write("scene.json", scene(&[format!("camera.blur={blur}")]));
    folder.run("lf-synth white scene.json -o white.exr -q").done();
    folder
}

/// The camera by `lf-calib lattice`, and what it says.
fn calibrated(folder: &Folder, words: &str) -> (Camera, String) {
    let ended = folder.run(&format!("lf-calib lattice white.exr -c nominal.json {words} -v -o camera.json"));
    (Camera::open(&folder.path("camera.json")).unwrap(), ended.stderr)
}

#[test]
fn the_blur_of_a_white_image_is_found() {
    for (layout, stop, f_number) in [
        ("square", "circle", 4.0),
        ("square", "circle", 8.0),
        ("square", "square", 8.0),
        ("hexagonal", "circle", 4.0),
        ("hexagonal", "square", 8.0),
    ] {
        for sigma_px in [0.3, 0.8] {
            let blur = format!("{{\"wavelength_nm\": 532, \"sigma_px\": {sigma_px}}}");
            let (camera, said) = calibrated(&white(layout, stop, f_number, &blur), "--wavelength 532");
            let found = camera.blur.unwrap();
            assert_eq!(found.wavelength_nm, Some(532.0));
            assert!(camera.calibration.unwrap()["lattice"].get("blur_sigma_px").is_some(), "{said}");
            let off = found.sigma_px - sigma_px;
            println!("{layout} {stop} f/{f_number} {sigma_px}: {off:+.4}");
            assert!(off.abs() < 0.01, "{layout} {stop} f/{f_number} {sigma_px}: {off:+.4}, {said}");
        }
    }
}

/// Scar: without a wavelength all blur became a Gaussian. With it lf-fit found 19 ghosts for 100 particles, booked
/// the misfit as noise and said nothing.
#[test]
fn rims_show_whether_light_diffracts() {
    let [diffracts, none] = [Some(GREEN_NM), None];
    for (layout, blur, wanted, sigma_px) in [
        ("square", r#"{"wavelength_nm": 532, "sigma_px": 0}"#, diffracts, 0.0),
        ("hexagonal", r#"{"wavelength_nm": 532, "sigma_px": 0.4}"#, diffracts, 0.4),
        ("square", r#"{"sigma_px": 0.5}"#, none, 0.5),
        ("hexagonal", r#"{"sigma_px": 0}"#, none, 0.0),
    ] {
        let (camera, said) = calibrated(&white(layout, "circle", 4.0, blur), "");
        let found = camera.blur.unwrap_or_default();
        assert_eq!(found.wavelength_nm, wanted, "{layout} {blur}: {said}");
        assert!((found.sigma_px - sigma_px).abs() < 0.02, "{layout} {blur}: {found:?} {said}");
        assert!(said.contains(if wanted.is_some() { "--wavelength" } else { "no diffraction" }), "{said}");
    }
}
