//! The blur that lf-calib reads from the rims of lenslet images, on white images whose blur is known.

use lf_core::Camera;
use lf_tests::{Call, Folder};

/// Sensor of 12 bits: 0.4 counts for an electron, read noise of 5 electrons.
const SENSOR: &str = "sensor_noise={\"gain_counts_per_electron\": 0.4, \"photon_noise\": true, \
    \"read_noise_electrons\": 5.0, \"bits\": 12}";

/// The blur of a white image by `lf-calib lattice`, and what it says. The nominal camera knows the wavelength alone.
fn found(layout: &str, stop: &str, f_number: f64, sigma_px: f64) -> (Option<f64>, String) {
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
    let blurred = format!("camera.blur={{\"wavelength_nm\": 532, \"sigma_px\": {sigma_px}}}");
    folder.write("scene.json", scene(&[blurred]));
    folder.run("lf-synth white scene.json -o white.exr -q").done();
    let ended = folder.run("lf-calib lattice white.exr -c nominal.json --wavelength 532 -v -o camera.json");
    let camera = Camera::open(&folder.path("camera.json")).unwrap();
    let blur = camera.blur.unwrap();
    assert_eq!(blur.wavelength_nm, Some(532.0));
    let is_written = camera.calibration.unwrap()["lattice"].get("blur_sigma_px").is_some();
    (is_written.then_some(blur.sigma_px), ended.stderr)
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
            let (blur, said) = found(layout, stop, f_number, sigma_px);
            let off = blur.unwrap_or_else(|| panic!("{said}")) - sigma_px;
            println!("{layout} {stop} f/{f_number} {sigma_px}: {off:+.4}");
            assert!(off.abs() < 0.01, "{layout} {stop} f/{f_number} {sigma_px}: {off:+.4}, {said}");
        }
    }
}
