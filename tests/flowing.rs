//! The pipeline's stage between fields and their mean.

use crate::weather::pipeline;
use lf_tests::scripts::has_programs;

#[test]
fn flows_are_made_of_fields_and_averaged_in_their_place() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    std::fs::create_dir(place.path().join("raw")).unwrap();
    for name in ["0001a.tif", "0001b.tif", "0002a.tif", "0002b.tif"] {
        std::fs::write(place.path().join("raw").join(name), "").unwrap();
    }
    let dry = |settings: &[&str]| {
        let out = place.path().join("out");
        let words: Vec<&str> = ["-n"].into_iter().chain(settings.iter().copied()).collect();
        String::from_utf8(pipeline(place.path(), &out, &words).output().unwrap().stdout).unwrap()
    };
    let plain = dry(&["correlate"]);
    assert!(plain.contains("field-0002a-0002b.exr") && !plain.contains("lf-flow"), "{plain}");
    let text = dry(&["FLOW=solenoidal", "FLOW_FLAGS=--sigma 1,1,1", "correlate"]);
    for pair in ["0001a-0001b", "0002a-0002b"] {
        let line = text.lines().find(|line| line.contains("lf-flow") && line.contains(pair)).expect("a line a pair");
        assert!(line.contains("solenoidal") && line.contains("--sigma 1,1,1"), "{line}");
        assert!(line.contains(&format!("out/field-{pair}.exr")) && line.contains(&format!("out/flow-{pair}.exr")));
    }
    // Other words are refused before the work.
    for words in ["FLOW=derive", "FLOW=solenoidal smooth"] {
        let out = place.path().join("out");
        let ended = pipeline(place.path(), &out, &["-n", words, "correlate"]).output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(
            !ended.status.success() && said.contains("FLOW: ") && said.contains("wanted solenoidal or smooth"),
            "{said}"
        );
    }
    // A volume that cannot be made takes what was made of it before along.
    let volume = text.lines().find(|line| line.contains("-o") && line.contains("volume-0001b.lfv")).unwrap();
    assert!(volume.contains("out/flow-0001a-0001b.exr"), "{volume}");

    // Scar: where the page of the run could not be made, an old one stayed, and make ended well.
    let out = place.path().join("out");
    std::fs::create_dir_all(&out).unwrap();
    std::fs::write(out.join("report.html"), "old").unwrap();
    let ended = pipeline(place.path(), &out, &["BIN=./none/", "report"]).output().unwrap();
    assert!(!ended.status.success() && !out.join("report.html").exists());
    assert!(String::from_utf8_lossy(&ended.stderr).contains("0 of 2 fields are in"));
}
