//! The wheel of `scripts/package/wheel`, in an environment of Python that has nothing else.

use crate::swapped::{done, python};
use lf_tests::Folder;
use lf_tests::tools::{path, workspace};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The demo's first steps on a small scene, from Python.
const STEPS: &str = "
import lf, sys
assert lf.__file__.startswith(sys.prefix), lf.__file__
setting = lambda key: ['--set', key]
keys = setting('frames=1') + setting('truth.pixels_per_voxel=[2,2,20]')
lf.write('scene.json', lf.run('lf-synth', 'scene', 'core-round', *keys))
lf.run('lf-synth', 'frames', 'scene.json', output='scene')
lf.run('lf-synth', 'white', 'scene.json', output='white.exr')
lf.run('lf-calib', 'lattice', 'white.exr', camera='scene/camera.json', output='camera.json')
account = lf.run('lf-prune', 'scene/frame-0000.exr', camera='camera.json', pvr=(2, 2, 20), depth=(-5, 5), o='s.lfv')
assert account['counts']['kept'] > 0, account
try:
    lf.run('lf-prune', 'no.exr', camera='camera.json', depth=(-5, 5))
except lf.Refused as refusal:
    assert 'no.exr' in str(refusal)
else:
    raise AssertionError('a missing file is not refused')
print(account['counts']['kept'])
";

/// Reads what the steps left, changes it, and writes it.
const READ: &str = "
import lf, numpy as np
support, frame = lf.read('s.lfv'), lf.read('scene/frame-0000.exr')
assert np.isfinite(np.asarray(support['score'])).sum() == lf.read_volume('s.lfv').indices.size
assert frame.shape == lf.Camera('camera.json').sensor_px[::-1] and float(frame.max()) > 0
lf.write('again.lfv', support)
assert open('again.lfv', 'rb').read() == open('s.lfv', 'rb').read()
layout, flow = lf.read_field('scene/flow.exr')
lf.write('again.exr', lf.read('scene/flow.exr'))
again, same = lf.read_field('again.exr')
assert again == layout and all(np.array_equal(flow[key], same[key], equal_nan=True) for key in flow)
lf.write('again.csv', lf.read('scene/particles.csv'))
assert lf.run('lf-validate', 'particles', 'scene/particles.csv', 'again.csv', camera='camera.json')['recall'] == 1
";

/// All files below a folder.
fn files(folder: &Path) -> BTreeSet<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { [path].into() }).collect()
}

#[test]
fn the_wheel_brings_the_tools_and_the_module() {
    let Some(mut venv) = python(&["venv", "ensurepip", "pip"]) else { return };
    let folder = Folder::new();
    let home = folder.path("venv");
    venv.args(["-m", "venv"]).arg(&home);
    done(venv);
    let within = |program: &str, words: &[&str]| {
        let mut command = Command::new(home.join("bin").join(program));
        command
            .args(words)
            .current_dir(folder.root())
            .env("PATH", format!("{}:/usr/bin:/bin", home.join("bin").display()));
        command.env("PYTHONDONTWRITEBYTECODE", "1").env("PIP_DISABLE_PIP_VERSION_CHECK", "1").env_remove("PYTHONPATH");
        command
    };
    let before = files(&home);

    let mut make = Command::new("python3");
    make.env("PYTHONDONTWRITEBYTECODE", "1")
        .arg(workspace().join("scripts/package/wheel"))
        .arg(folder.path("dist"))
        .arg(path("lf-synth").parent().unwrap());
    let made = String::from_utf8(done(make).stdout).unwrap();
    done(within("pip", &["install", "--quiet", "--no-index", made.trim()]));

    let version = String::from_utf8(done(within("lf-synth", &["--version"])).stdout).unwrap();
    assert_eq!(version.trim(), format!("lf-synth {}", env!("CARGO_PKG_VERSION")));
    let shown = String::from_utf8(done(within("pip", &["show", "lf-piv"])).stdout).unwrap();
    assert!(shown.contains(&format!("Version: {}\n", env!("CARGO_PKG_VERSION"))), "{shown}");
    done(within("python", &["-c", STEPS]));
    if let Some(mut place) = python(&["numpy", "OpenEXR", "xxhash"]) {
        place.args(["-c", "import numpy, os; print(os.path.dirname(os.path.dirname(numpy.__file__)), end='')"]);
        let packages = String::from_utf8(done(place).stdout).unwrap();
        let mut read = within("python", &["-c", READ]);
        read.env("PYTHONPATH", packages);
        done(read);
    }
    done(within("pip", &["uninstall", "--quiet", "--yes", "lf-piv"]));
    assert_eq!(files(&home), before);
}
