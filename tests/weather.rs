//! scripts/pipeline.mk in bad weather: broken and missing frames, a kill, two runs at once, a full disk.

use lf_tests::scripts::{has_programs, link_tools};
use lf_tests::tools::workspace;
use lf_tests::{Call, Folder};
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Time limit of each wait.
const PATIENCE: Duration = Duration::from_secs(300);

/// A folder with the tools, a white image, a nominal camera and four pairs of frames of 168 x 168 px in `raw`. Made
/// once.
pub fn campaign() -> &'static Path {
    static CAMPAIGN: OnceLock<Folder> = OnceLock::new();
    let folder = CAMPAIGN.get_or_init(|| {
        let folder = Folder::shared();
        fs::create_dir(folder.path("raw")).unwrap();
        link_tools(&folder.path("tools"));
        let line = "export LF_HISTORY=off PATH=$PWD/tools:$PATH; set -e
            lf-synth scene uniform --set camera.main_lens.aperture=circle --set truth=null \\
                --set camera.sensor.width=168 --set camera.sensor.height=168 --set 'volume.x_mm=[-0.231,0.231]' \\
                --set 'volume.y_mm=[-0.231,0.231]' --set 'volume.z_mm=[-1,1]' --set particles.rays=20000 > scene.json
            lf-synth white scene.json -o white.exr -q
            for n in 1 2 3 4; do
                lf-synth frames scene.json --seed $n --format tiff -o taken -q
                mv taken/frame-0000.tif raw/000${n}a.tif; mv taken/frame-0001.tif raw/000${n}b.tif
            done
            lf-synth frames scene.json --format tiff -o taken -q
            sed 's/\"width\": 168/\"width\": 182/' scene.json > wide.json
            lf-synth frames wide.json --format tiff -o wide -q";
        let made = Command::new("sh").args(["-c", line]).current_dir(folder.root()).output().unwrap();
        assert!(made.status.success(), "{}", said(&made));
        folder
    });
    folder.root()
}

/// A copy of the campaign's frames in a new folder, to be spoilt.
pub fn copy() -> TempDir {
    let place = tempfile::tempdir().unwrap();
    fs::create_dir(place.path().join("raw")).unwrap();
    for entry in fs::read_dir(campaign().join("raw")).unwrap().map(Result::unwrap) {
        fs::copy(entry.path(), place.path().join("raw").join(entry.file_name())).unwrap();
    }
    place
}

/// The pipeline on the frames in `folder`, results to `out`. The correlation alone decides.
pub fn pipeline(folder: &Path, out: &Path, more: &[&str]) -> Command {
    let from = campaign();
    let mut command = Command::new("make");
    command.arg("-f").arg(workspace().join("scripts/pipeline.mk")).current_dir(folder);
    command.env_remove("MAKEFLAGS").env("LF_HISTORY", "off");
    let name = |name: &str, path: PathBuf| format!("{name}={}", path.display());
    command.args([name("BIN", from.join("tools")) + "/", name("WHITE", from.join("white.exr"))]);
    command.args([name("NOMINAL", from.join("taken/camera.json")), name("OUT", out.to_owned())]);
    command.args(["PVR=1,1,10", "DEPTH=-1,1", "BOUNDS=-0.231,0.231,-0.231,0.231", "INITIAL_MM=0.3,0.3,1"]);
    command.args(["WINDOW_MM=0.2,0.2,0.8", "THREADS=1", "FIT=0"]).args(more);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Names and bytes of the results: volumes, fields and their mean.
fn results(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let names = fs::read_dir(out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let is_result = |name: &String| name.ends_with(".lfv") || name.ends_with(".exr") || name.ends_with(".vti");
    names.filter(is_result).map(|name| (name.clone(), fs::read(out.join(&name)).unwrap())).collect()
}

/// Files that a stopped process may leave behind.
fn leftovers(out: &Path) -> Vec<String> {
    let names = fs::read_dir(out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.ends_with(".part")).collect()
}

/// Whether the file system has files without a name (tmpfs, ext4 and XFS do). Elsewhere a killed process leaves a file.
#[cfg(target_os = "linux")]
fn has_nameless_files(folder: &Path) -> bool {
    use std::os::unix::fs::OpenOptionsExt;
    let flags = rustix::fs::OFlags::TMPFILE.bits() as i32;
    fs::File::options().write(true).custom_flags(flags).open(folder).is_ok()
}

#[cfg(not(target_os = "linux"))]
fn has_nameless_files(_: &Path) -> bool {
    false
}

/// The results that were made, sorted; one line for each.
fn done(out: &Path) -> Vec<String> {
    let mut lines: Vec<String> =
        fs::read_to_string(out.join("log/done.txt")).unwrap().lines().map(str::to_owned).collect();
    lines.sort();
    lines
}

/// Results of an undisturbed run.
pub fn undisturbed() -> &'static BTreeMap<String, Vec<u8>> {
    static RESULTS: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    RESULTS.get_or_init(|| {
        let place = tempfile::tempdir().unwrap();
        let ended = pipeline(campaign(), place.path(), &["-j2"]).output().unwrap();
        assert!(ended.status.success(), "{}", said(&ended));
        let results = results(place.path());
        // Four pairs give 8 supports, 8 volumes and 4 fields; there are two backgrounds, and the mean in two formats.
        assert_eq!(results.len(), 24, "{:?}", results.keys());
        results
    })
}

fn wait_for(what: &str, mut is_there: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_there() {
        assert!(begun.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn particles_decide_unless_they_are_turned_off() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let one = "PAIRS=0001a-0001b";
    let usual = pipeline(campaign(), place.path(), &["-n", one]);
    let mut command = Command::new("make");
    command.args(usual.get_args().filter(|word| *word != "FIT=0")).current_dir(campaign()).env_remove("MAKEFLAGS");
    let planned = String::from_utf8(command.output().unwrap().stdout).unwrap();
    assert!(planned.contains("lf-fit") && planned.contains("--particles"), "{planned}");
    let ended = pipeline(campaign(), place.path(), &[one, "FIT=1"]).output().unwrap();
    assert!(ended.status.success(), "{}", said(&ended));
    let has_tables = ["a", "b"].iter().all(|end| place.path().join(format!("particles-0001{end}.csv")).exists());
    let field = fs::read(place.path().join("field-0001a-0001b.exr")).unwrap();
    assert!(has_tables && field != undisturbed()["field-0001a-0001b.exr"], "{}", said(&ended));
}

#[test]
fn bad_frames_fail_alone_are_named_and_can_be_mended() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = copy();
    let (raw, out) = (place.path().join("raw"), place.path().join("out"));
    let good = fs::read(raw.join("0002a.tif")).unwrap();
    fs::write(raw.join("0002a.tif"), &good[..good.len() / 3]).unwrap();
    fs::copy(campaign().join("wide/frame-0001.tif"), raw.join("0003b.tif")).unwrap();
    fs::remove_file(raw.join("0004b.tif")).unwrap();
    let ended = pipeline(place.path(), &out, &["-j2"]).output().unwrap();
    let text = said(&ended);
    assert_eq!(ended.status.code(), Some(2), "{text}");
    let last: Vec<&str> =
        text.lines().filter(|line| line.starts_with("no field ") || line.contains(" fields are")).collect();
    assert_eq!(last.len(), 4, "{text}");
    assert!(last[0].starts_with("no field 0002a-0002b: lf-prune: raw/0002a.tif: "), "{}", last[0]);
    assert!(last[1].starts_with("no field 0003a-0003b: lf-prune: "), "{}", last[1]);
    assert!(["raw/0003b.tif", "182 x 168", "168 x 168"].iter().all(|word| last[1].contains(word)), "{}", last[1]);
    assert_eq!(last[2], "no field 0004a-0004b: raw/0004b.tif: no such file");
    assert!(last[3].starts_with("1 of 4 fields are in "), "{}", last[3]);
    let mean = fs::read_to_string(out.join("mean.json")).unwrap();
    assert!(mean.contains("\"fields\": 1,"), "{mean}");
    let background = fs::read_to_string(out.join("log/background-b.txt")).unwrap();
    assert!(background.contains("warning: left out: raw/0003b.tif: 182 x 168 px"), "{background}");
    assert!(leftovers(&out).is_empty());

    // With good frames in their places, only the missing results are made.
    let before = done(&out);
    for name in ["0002a.tif", "0003b.tif", "0004b.tif"] {
        fs::copy(campaign().join("raw").join(name), raw.join(name)).unwrap();
    }
    let ended = pipeline(place.path(), &out, &["-j2"]).output().unwrap();
    assert!(ended.status.success(), "{}", said(&ended));
    let after = done(&out);
    let mut once = after.clone();
    once.dedup();
    assert_eq!(after, once);
    assert!(before.len() < after.len() && after.len() == 23, "{after:?}");
    assert!(fs::read_to_string(out.join("mean.json")).unwrap().contains("\"fields\": 4,"));

    // If a frame goes bad later, its old field is no longer a result.
    fs::write(raw.join("0002a.tif"), &good[..good.len() / 3]).unwrap();
    let ended = pipeline(place.path(), &out, &[]).output().unwrap();
    assert_eq!(ended.status.code(), Some(2));
    assert!(said(&ended).contains("no field 0002a-0002b: lf-prune: raw/0002a.tif: "), "{}", said(&ended));
    assert!(fs::read_to_string(out.join("mean.json")).unwrap().contains("\"fields\": 3,"));
}

#[test]
fn without_windows_the_first_good_pair_decides_for_all() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = copy();
    let out = place.path().join("out");
    fs::write(place.path().join("raw/0001a.tif"), "no image").unwrap();
    let ended = pipeline(place.path(), &out, &["-j2", "INITIAL_MM=", "WINDOW_MM="]).output().unwrap();
    let text = said(&ended);
    assert_eq!(ended.status.code(), Some(2), "{text}");
    assert!(text.contains("no field 0001a-0001b: lf-prune: raw/0001a.tif: "), "{text}");
    assert!(fs::read_to_string(out.join("mean.json")).unwrap().contains("\"fields\": 3,"), "{text}");
    let words = fs::read_to_string(out.join("windows.txt")).unwrap();
    let sides = words.strip_prefix("--window-mm ").unwrap().trim();
    let second = ["volume-0002a.lfv", "volume-0002b.lfv"].map(|name| out.join(name));
    let said = Call::new("lf-xcorr").words(second).words(["--estimate", "-q"]).run().done().text();
    assert!(said.contains(&format!("\"window_mm\":[{sides}]")), "{said} {words}");
}

#[test]
fn a_killed_run_leaves_no_half_file_and_can_be_continued() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let out = place.path();
    for share in 1..=3 {
        let mut running = pipeline(campaign(), out, &["-j2"]).process_group(0).spawn().unwrap();
        let there = |out: &Path| results(out).len();
        let before = there(out);
        wait_for("results", || there(out) >= before + 4 || running.try_wait().unwrap().is_some());
        // No process of the group can tidy up after SIGKILL.
        Command::new("sh").arg("-c").arg(format!("kill -KILL -{}", running.id())).status().unwrap();
        running.wait().unwrap();
        assert!(leftovers(out).is_empty() || !has_nameless_files(out), "kill {share}: {:?}", leftovers(out));
        for (name, bytes) in results(out) {
            assert!(undisturbed().get(&name).is_none_or(|whole| *whole == bytes), "kill {share}: {name} differs");
        }
    }
    let ended = pipeline(campaign(), out, &["-j2"]).output().unwrap();
    assert!(ended.status.success(), "{}", said(&ended));
    assert!(results(out) == *undisturbed());
}

#[test]
fn two_runs_in_one_folder_end_in_the_same_results() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let [one, other] = [1, 2].map(|_| pipeline(campaign(), place.path(), &["-j2"]).spawn().unwrap());
    for run in [one, other] {
        let ended = run.wait_with_output().unwrap();
        assert!(ended.status.success(), "{}", said(&ended));
    }
    assert!(results(place.path()) == *undisturbed());
    assert!(leftovers(place.path()).is_empty());
}

#[test]
fn a_full_disk_refuses_the_next_result_and_harms_no_other() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("small");
    fs::create_dir(&out).unwrap();
    let mount = |options: &str| {
        let mut command = Command::new("mount");
        command.args(["-t", "tmpfs", "-o", options, "tmpfs"]).arg(&out).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    if !mount("size=256k") {
        eprintln!("a small disk cannot be mounted here: not tested");
        return;
    }
    let full = pipeline(campaign(), &out, &["-j2"]).output().unwrap();
    let left = leftovers(&out);
    let text = said(&full);
    let grown = mount("remount,size=64m");
    let taken_up = pipeline(campaign(), &out, &["-j2"]).output().unwrap();
    let found = results(&out);
    assert!(Command::new("umount").arg(&out).status().unwrap().success());
    assert_eq!(full.status.code(), Some(2), "{text}");
    assert!(text.contains("no space left on device; wanted room for the whole output"), "{text}");
    assert!(left.is_empty(), "{left:?}");
    assert!(grown && taken_up.status.success(), "{}", said(&taken_up));
    assert!(found == *undisturbed());
}
