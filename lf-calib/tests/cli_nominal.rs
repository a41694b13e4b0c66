//! `nominal`: the camera by its data sheets, what is said of it, and what does not fit.

use crate::workbench::{refused, workbench};
use lf_core::Camera;

const SHEET: &str = "nominal --sensor 6600x4400 --pixel 5.5um --f 200 --magnification 1 --pitch 77um --lenslet-f 308um";

#[test]
fn the_camera_of_the_data_sheets() {
    let bench = workbench();
    bench.run(&format!("{SHEET} --f-number 4 --layout hex -o nominal.json")).done();
    let camera = Camera::open(&bench.path("nominal.json")).unwrap();
    assert_eq!((camera.sensor.width, camera.sensor.height, camera.sensor.pixel_pitch_mm), (6600, 4400, 0.0055));
    assert_eq!(camera.main_lens.working_f_number, 4.0);
    assert_eq!((camera.microlenses.pitch_mm, camera.microlenses.focal_length_mm), (0.077, 0.308));
    assert_eq!(serde_json::to_value(camera.microlenses.layout).unwrap(), "hexagonal");
    let nominal = &camera.calibration.unwrap()["nominal"];
    assert_eq!(nominal["target_depths_mm"].as_array().unwrap().len(), 6);
    assert_eq!(nominal["pixels_per_voxel"], serde_json::json!([1.0, 1.0, 10.0]));
}

#[test]
fn what_is_said_of_a_camera() {
    let bench = workbench();
    let run = bench.run(&format!("{SHEET} --f-number 4"));
    let text = run.stderr;
    for words in [
        "useful depth: z from -4.4 to 4.3 mm",
        "light sheet: best within z from -2.83 to -0.44 or from 0.43 to 3.09 mm, where z of a lone particle is known to 0.09 px",
        "--pvr 1,1,10 --depth -4.36,4.27",
        "--depths -4.3,-3.1,-1.9,1.9,3.1,4.3",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(!text.contains("warning"), "{text}");
    let text = bench.run(&format!("{SHEET} --f-number 2")).stderr;
    assert!(text.contains("warning: lenslet images overlap: 28.0 px wide on a pitch of 14.0 px, +100 %"), "{text}");
    let quiet = bench.run(&format!("{SHEET} --ring 2 -q"));
    assert!(quiet.stderr.is_empty(), "{quiet:?}");
    assert_eq!(Camera::from_json(&quiet.text()).unwrap().main_lens.working_f_number, 4.0);
}

#[test]
fn water_gives_a_longer_camera_in_air_or_a_medium() {
    let bench = workbench();
    let camera = |rest: &str| {
        let run = bench.run(&format!("{SHEET} --f-number 4 {rest} -q"));
        Camera::from_json(&run.text()).unwrap()
    };
    let air = camera("--water");
    assert!((air.wavelength_of_nm(533.2) - 400.0).abs() < 1e-9);
    assert_eq!((air.main_lens.focal_length_mm, air.main_lens.working_f_number), (266.6, 5.332));
    assert_eq!((air.microlenses.focal_length_mm, air.medium), (0.410_564, None));
    let exact = camera("--water 1.4 --window 18cm,20mm,1.49 --exact");
    let medium = exact.medium.unwrap();
    assert_eq!((medium.index, medium.window_z_mm, medium.window_thickness_mm), (1.4, 180.0, 20.0));
    assert_eq!(exact.main_lens.focal_length_mm, 200.0);
    let run = bench.run(&format!("{SHEET} --f-number 4 --water --window 180,20,1.49"));
    let text = run.stderr;
    assert!(text.contains("warning: the equivalent camera in air is off by "), "{text}");
}

/// A microscope of 20 times and numerical aperture 0.5 in water. Its f-number is 20 / (2 0.5), and in focus a pixel of
/// 6.5 um is one of 0.325 um.
#[test]
fn a_microscope_by_its_data_sheet() {
    let bench = workbench();
    let array = "--sensor 1608x1208 --pixel 6.5um --pitch 125um --lenslet-f 2.5mm";
    let run = bench.run(&format!("nominal {array} --microscope 0.5,1.33 --f 10 --tube-lens 200"));
    let camera = Camera::from_json(&run.text()).unwrap();
    let lens = &camera.main_lens;
    assert_eq!((lens.magnification, lens.working_f_number, lens.focal_length_mm), (20.0, 20.0, 10.0));
    assert_eq!((lens.telecentric.unwrap().index, camera.image_growth()), (1.33, 0.0));
    for words in [
        "magnification 20.0000, working f-number 20.0000",
        "a pixel 0.3250 um",
        "useful depth: z from -159.9 to 159.9 um",
    ] {
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
    assert!(run.stderr.contains("--depth -0.15986,0.15986"), "{}", run.stderr);
    // The focal length plays no part, and a lens in air has the index 1.
    let run = bench.run(&format!("nominal {array} --microscope 0.5 --magnification 20 -q"));
    let other = Camera::from_json(&run.text()).unwrap();
    assert_eq!((other.main_lens.focal_length_mm, other.main_lens.telecentric.unwrap().index), (10.0, 1.0));
    let run = bench.run(&format!("nominal {array} --telecentric --magnification 0.5 --f-number 20 -q"));
    let other = Camera::from_json(&run.text()).unwrap();
    assert!(other.main_lens.telecentric.is_some() && !other.has_steep_rays());
    bench
        .run(&format!("nominal {array} --microscope 1.1 --magnification 20 -o out"))
        .refused("wanted a numerical aperture");
    bench.run(&format!("nominal {array} --microscope 0.5 -o out")).refused("--magnification");
}

#[test]
fn data_sheets_that_cannot_be() {
    let bench = workbench();
    let line = SHEET.replace("77um", "77");
    refused(
        &bench,
        &format!("{line} --f-number 4 -o out"),
        "the data sheets: microlenses.pitch_mm is 77 (77 um are 0.077 mm); wanted lenslets of 1 to 1000 pixels of 0.0055 mm",
    );
    refused(&bench, &format!("{SHEET} --f-number 4 --water 5 -o out"), "--water: 5; wanted an index of 1 to 4");
    bench.run(&format!("{SHEET} -o out")).refused("--f-number");
    bench.run(&format!("{SHEET} --f-number 4 --pixel 5,5um -o out")).refused("pixel");
    bench.run(&format!("{SHEET} --f-number 4 --exact -o out")).refused("--window");
    assert!(!bench.path("out").exists());
}
