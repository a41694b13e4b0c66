//! The object frame, seen from outside: x right and y up in the picture, z towards the camera, and its mark in files.

use lf_core::{Field, image};
use lf_tests::{Folder, samples::Samples};

const PARTICLES: &str = "frame,id,x_mm,y_mm,z_mm,intensity\n";
const MARK: &str = "# frame: right-handed\n";

/// A small scene of the simulations' camera; particles come from `given.csv`.
fn scene(folder: &Folder, keys: &[&str]) {
    let from_table = ["particles.per_lenslet=null", "particles.csv=given.csv", "particles.rays=20000"];
    let small = ["volume.x_mm=[-0.9,0.9]", "volume.y_mm=[-0.9,0.9]"];
    folder.scene("core", &[&from_table[..], &small, keys].concat());
}

/// Centroid of an image's light, columns and rows from its middle.
fn centroid(folder: &Folder, name: &str) -> [f64; 2] {
    let pixels = image::open_counts(&folder.path(name), None).unwrap().pixels;
    let (mut sum, mut moment) = (0.0, [0.0; 2]);
    for ((row, column), light) in pixels.indexed_iter() {
        let light = f64::from(*light);
        sum += light;
        moment = [moment[0] + light * column as f64, moment[1] + light * row as f64];
    }
    let middle = [pixels.ncols(), pixels.nrows()].map(|count| 0.5 * (count as f64 - 1.0));
    [0, 1].map(|axis| moment[axis] / sum - middle[axis])
}

/// By hand: 0.55 mm are 100 px at m = 1. A lenslet of 14 px takes all light of a point in focus.
#[test]
fn a_particle_on_the_right_and_above_is_there_in_the_picture() {
    let folder = Folder::new();
    folder.write("given.csv", format!("{MARK}{PARTICLES}0,0,0.55,0.275,0,1000\n"));
    scene(&folder, &["frames=1"]);
    folder.run("lf-synth frames scene.json -o .").silent();
    let [column, row] = centroid(&folder, "frame-0000.exr");
    assert!((column - 100.0).abs() < 7.5 && (row + 50.0).abs() < 2.0, "{column} {row}");
}

/// The flow turns anticlockwise about z. So the particle on the right moves up in the picture.
#[test]
fn positive_rotation_is_anticlockwise_in_the_picture() {
    let folder = Folder::new();
    folder.write("given.csv", format!("{MARK}{PARTICLES}0,0,0.55,0,0,1000\n"));
    scene(&folder, &["frames=2", "flow={\"kind\": \"rotation\", \"axis\": [0, 0, 1], \"angle_rad\": 0.5}"]);
    folder.run("lf-synth frames scene.json -o .");
    let [before, after] = ["frame-0000.exr", "frame-0001.exr"].map(|name| centroid(&folder, name));
    // 100 px turned by 0.5 rad.
    assert!((before[0] - 100.0).abs() < 7.5 && before[1].abs() < 0.01, "{before:?}");
    assert!((after[0] - 87.8).abs() < 6.6 && (after[1] + 47.9).abs() < 2.3, "{after:?}");
}

/// The values of an array of a `.vti`.
fn array(bytes: &[u8], name: &str) -> Vec<f32> {
    let text = String::from_utf8_lossy(bytes);
    let after = text.split_once(&format!("Name=\"{name}\"")).expect("the array").1;
    let offset: usize = after.split("offset=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
    let data = b"<AppendedData encoding=\"raw\">\n_";
    let start = bytes.windows(data.len()).position(|part| part == data).unwrap() + data.len() + offset;
    let count = u64::from_le_bytes(bytes[start..start + 8].try_into().unwrap()) as usize;
    let values = bytes[start + 8..start + 8 + count].chunks_exact(4);
    values.map(|value| f32::from_le_bytes(value.try_into().unwrap())).collect()
}

/// From two images to vectors and to ParaView: a vortex that turns anticlockwise as the camera sees it goes up on the
/// right and to the left at the top, and has positive vorticity about z.
#[test]
fn a_vortex_has_the_sign_that_the_camera_sees() {
    let folder = Folder::new();
    let keys = [
        "volume.x_mm=[-0.9,0.9]",
        "volume.y_mm=[-0.9,0.9]",
        "volume.z_mm=[1,3]",
        "particles.rays=20000",
        "flow={\"kind\": \"rotation\", \"axis\": [0, 0, 1], \"angle_rad\": 0.03}",
    ];
    folder.scene("uniform", &keys);
    folder.run("lf-synth frames scene.json -o .");
    for n in ["0000", "0001"] {
        let bounds = "--depth 1,3 --bounds -0.9,0.9,-0.9,0.9";
        folder.run(&format!("lf-prune frame-{n}.exr -c camera.json --pvr 2,2,10 {bounds} -o support.lfv"));
        folder.run(&format!("lf-mart support.lfv -i frame-{n}.exr -c camera.json --iterations 10 -o volume-{n}.lfv"));
    }
    folder.run("lf-xcorr volume-0000.lfv volume-0001.lfv --window 48,48,32 -o field.exr --plot field.svg");
    let field = Field::open(&folder.path("field.exr")).unwrap();
    let (mut right, mut top) = (0, 0);
    for i in 0..field.len() {
        let ([x, y, _], moved) = (field.place_mm(i), field.displacement_mm(i));
        right += usize::from(x > 0.3);
        top += usize::from(y > 0.3);
        assert!(x.abs() < 0.3 || moved.y * x > 0.0, "{moved} at {x}, {y}");
        assert!(y.abs() < 0.3 || moved.x * y < 0.0, "{moved} at {x}, {y}");
    }
    assert!(right > 0 && top > 0);
    folder.run("lf-validate ensemble field.exr -o mean.vti");
    let vti = folder.bytes("mean.vti");
    let vorticity: Vec<f32> = array(&vti, "vorticity").chunks_exact(3).map(|about| about[2]).collect();
    let mean = vorticity.iter().sum::<f32>() / vorticity.len() as f32;
    // A rotation has twice its angle.
    assert!((mean - 0.06).abs() < 0.0004, "{mean}");
    assert!(String::from_utf8_lossy(&vti).contains("<!-- Frame: right-handed;"));
    let error = folder.run("lf-validate displacement scene.json field.exr -c camera.json").json();
    for (axis, most) in [("u", 0.08), ("v", 0.065), ("w", 0.37)] {
        assert!(error[format!("rms_{axis}_px")].as_f64().unwrap() < most, "{error}");
    }
}

/// Bytes with blanks in place of the mark: a file of lf 0.1.0.
fn without_mark(bytes: &[u8]) -> Vec<u8> {
    let mark = b"\"frame\":\"right-handed\",";
    let at = bytes.windows(mark.len()).position(|part| part == mark).expect("a marked file");
    let mut bytes = bytes.to_vec();
    bytes[at..at + mark.len()].fill(b' ');
    bytes
}

#[test]
fn volumes_and_fields_of_the_older_frame_are_refused() {
    let samples = Samples::new();
    for name in ["support.lfv", "volume.lfv", "field.exr"] {
        samples.write(&format!("old-{name}"), without_mark(&samples.bytes(name)));
        let found = "its header names no frame: lf 0.1.0 wrote it, with x to the left";
        let wanted = "wanted \"frame\": \"right-handed\"; make the file again from the images";
        let message = format!("old-{name}: {found}; {wanted}");
        samples.call(&format!("lf-validate info old-{name}")).run().refused_with(&message);
    }
    let refused = |line: &str| samples.call(line).run().refused("names no frame");
    refused("lf-mart old-support.lfv -i image.exr -c camera.json -o new.lfv");
    refused("lf-xcorr volume.lfv old-volume.lfv -o new.exr");
    refused("lf-validate displacement old-field.exr field.exr");
    for name in ["support.lfv", "field.exr", "camera.json"] {
        let about = samples.run(&format!("lf-validate info {name}")).text();
        assert!(about.lines().any(|line| line.split_whitespace().eq(["frame", "right-handed"])), "{about}");
    }
}

#[test]
fn tables_and_scenes_without_a_frame_are_not_mixed_in_silence() {
    let samples = Samples::new();
    let rows = "0,0,0.1,0,0,1000\n1,0,0.11,0,0,1000\n";
    samples.write("marked.csv", format!("{MARK}{PARTICLES}{rows}"));
    samples.write("bare.csv", format!("{PARTICLES}{rows}"));
    samples.write("left.csv", format!("# frame: left-handed\n{PARTICLES}{rows}"));
    let scored = |name: &str| samples.call(&format!("lf-validate displacement {name} field.exr")).run();
    let (marked, bare) = (scored("marked.csv").done(), scored("bare.csv").done());
    assert_eq!(marked.text(), bare.text());
    assert!(!marked.stderr.contains("frame"), "{}", marked.stderr);
    let warning = "lf-validate: warning: bare.csv: no line '# frame: right-handed'; x is read as rightwards in the \
                   picture and y as upwards. Add the line; in a table of lf 0.1.0 change the sign of x first";
    assert!(bare.stderr.lines().any(|line| line == warning), "{}", bare.stderr);
    scored("left.csv").refused_with("left.csv: its frame is 'left-handed'; wanted '# frame: right-handed'");

    samples.scene("uniform", &["frame=null"]);
    scored("scene.json").refused("scene.json: names no frame");
    samples
        .call("lf-synth scene uniform --set frame=left-handed")
        .run()
        .refused("frame is 'left-handed', not 'right-handed'");
}

/// No key of a camera depends on the frame, so data sheets need no mark. Cameras that tools write have it.
#[test]
fn a_camera_needs_no_mark() {
    let samples = Samples::new();
    let camera = samples.json("camera.json");
    assert_eq!(camera["frame"], "right-handed");
    let pruned = |name: &str| {
        samples.run(&format!("lf-prune image.exr -c {name} --depth -0.2,0.2 -o support.lfv"));
        samples.bytes("support.lfv")
    };
    let marked = pruned("camera.json");
    let mut bare = camera.clone();
    bare.as_object_mut().unwrap().remove("frame");
    samples.write("bare.json", bare.to_string());
    assert!(pruned("bare.json") == marked);
    bare["frame"] = "left-handed".into();
    samples.write("left.json", bare.to_string());
    samples.call("lf-validate info left.json").run().refused("frame is 'left-handed', not 'right-handed'");
}
