//! The walls between the crates, and between the command line and the library of each tool.

use crate::sources::{EXAMPLE, LIBRARIES, Source, crates, sources, tools};
use lf_tests::tools::{TOOLS, cargo, workspace};
use serde_json::Value;
use std::path::Path;

/// The two sides of the wall inside a tool.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    /// The command line: main.rs and the modules that it declares.
    Cli,
    /// The library: everything else.
    Library,
}

/// The sources of one side of a tool.
fn side(tool: &str, side: Side) -> Vec<Source> {
    let folder = workspace().join(tool).join("src");
    let mut all = sources(&folder);
    let main = all.iter().find(|source| source.path == folder.join("main.rs")).expect("a tool has a main.rs");
    let modules = main.modules();
    let is_cli = |path: &Path| {
        let first = path.strip_prefix(&folder).unwrap().iter().next().unwrap().to_string_lossy().into_owned();
        let stem = first.trim_end_matches(".rs");
        stem == "main" || modules.iter().any(|module| module == stem)
    };
    all.retain(|source| is_cli(&source.path) == (side == Side::Cli));
    assert!(!all.is_empty(), "{tool} has sources");
    all
}

/// Lines of code of a source, without comments and without its tests, numbered from 1.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().take_while(|line| line.trim() != "#[cfg(test)]");
    lines.enumerate().map(|(n, line)| (n + 1, line.split("//").next().unwrap_or_default()))
}

/// The places at which the code of `sources` has one of `words`.
fn mentions(sources: &[Source], words: &[&str]) -> Vec<String> {
    let mut found = Vec::new();
    for source in sources {
        for (n, line) in code(&source.text) {
            if let Some(word) = words.iter().find(|word| line.contains(**word)) {
                found.push(format!("{}:{n} has `{word}`", source.name()));
            }
        }
    }
    found
}

fn packages() -> Vec<Value> {
    let output = cargo().args(["metadata", "--no-deps", "--format-version", "1"]).output().unwrap();
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

// The renderer judges the reconstruction. If both used the same weights, an error in them would never show.
#[test]
fn the_renderer_knows_nothing_of_the_weights() {
    for folder in ["src", "tests", "benches", "examples"] {
        for source in sources(&workspace().join("lf-synth").join(folder)) {
            assert!(!source.text.contains("weights::"), "{} uses the weights", source.name());
        }
    }
}

#[test]
fn no_tool_depends_on_another() {
    let packages = packages();
    for tool in TOOLS.into_iter().chain(LIBRARIES).chain([EXAMPLE.0]) {
        let package = packages.iter().find(|package| package["name"] == tool).unwrap();
        for dependency in package["dependencies"].as_array().unwrap() {
            let name = dependency["name"].as_str().unwrap();
            assert!(!TOOLS.contains(&name), "{tool} depends on {name}");
        }
    }
}

#[test]
fn every_member_is_known_to_these_tests() {
    for package in packages() {
        let name = package["name"].as_str().unwrap().to_owned();
        assert!(TOOLS.into_iter().chain(LIBRARIES).chain(["lf-tests", EXAMPLE.0]).any(|known| known == name), "{name}");
    }
}

#[test]
fn every_package_says_what_it_is_and_where() {
    for package in packages() {
        for key in ["description", "license", "repository", "rust_version"] {
            assert!(package[key].as_str().is_some_and(|text| !text.is_empty()), "{} has no {key}", package["name"]);
        }
        for key in ["keywords", "categories"] {
            assert!(package[key].as_array().is_some_and(|list| !list.is_empty()), "{} has no {key}", package["name"]);
        }
    }
}

// A loop over data in the command line is work that the library does not offer.
#[test]
fn command_lines_hold_no_loop_over_voxels_or_pixels() {
    const DATA: [&str; 10] =
        ["indices", "pixels", "voxel", "intensity", "score", "column(", "shape", "width", "height", ".len()"];
    for tool in tools() {
        for source in side(tool, Side::Cli) {
            for (n, line) in code(&source.text) {
                let start = line.trim_start();
                let place = format!("{}:{n}", source.name());
                assert!(!start.starts_with("while ") && !start.starts_with("loop "), "{place} has a loop");
                if let Some((_, over)) = start.strip_prefix("for ").and_then(|rest| rest.split_once(" in ")) {
                    let over = if over.starts_with('[') { "a few literals" } else { over };
                    assert!(!DATA.iter().any(|word| over.contains(word)), "{place} loops over {over}");
                }
            }
            assert_eq!(mentions(&[source], &["par_iter", "for_each_init", "unsafe"]), [""; 0]);
        }
    }
}

#[test]
fn libraries_have_no_paths_no_printing_no_clock_and_no_globals() {
    const FOREIGN: [&str; 12] = [
        "println!",
        "print!(",
        "eprint",
        "dbg!",
        "std::path",
        "std::fs",
        "std::env",
        "std::process",
        "Instant",
        "SystemTime",
        "static mut",
        "thread_local!",
    ];
    for tool in tools() {
        let mut found = mentions(&side(tool, Side::Library), &FOREIGN);
        // The keys of a scene hold names of files.
        let keys = ["scene/keys.rs", "sensor.rs"].map(|file| format!("lf-synth/src/{file}"));
        found.retain(|place| !(keys.iter().any(|file| place.contains(file)) && place.ends_with("`std::path`")));
        assert_eq!(found, [""; 0]);
    }
}

#[test]
fn one_file_of_the_plots_knows_files() {
    let mut plot = sources(&workspace().join("lf-core/lf-plot/src"));
    plot.retain(|source| !source.path.ends_with("save.rs"));
    assert_eq!(mentions(&plot, &["std::fs", "std::path", "lf_core::io", "lf_core::cli"]), [""; 0]);
}

#[test]
fn the_weights_know_no_files() {
    let weights = workspace().join("lf-core/src/weights");
    assert_eq!(mentions(&sources(&weights), &["std::fs", "std::path", "crate::io", "crate::image"]), [""; 0]);
    let mut optics = sources(&workspace().join("lf-core/src"));
    optics.retain(|source| source.name().contains("src/optics"));
    assert!(!optics.is_empty());
    assert_eq!(mentions(&optics, &["weights::", "std::fs", "std::path"]), [""; 0]);
}

// Mapping a file, signals and vector instructions need unsafe code. It stays where a reader looks for it.
#[test]
fn unsafe_code_has_its_places() {
    let is_place = |path: &Path| {
        let name = path.file_name().unwrap().to_string_lossy();
        path.ends_with("lf-core/src/io/bytes.rs")
            || path.ends_with("lf-core/src/io/os/faults.rs")
            || path.components().any(|part| part.as_os_str() == "weights")
            || name == "simd.rs"
            || name.starts_with("kernel")
    };
    for folder in crates() {
        let mut all = sources(&workspace().join(folder).join("src"));
        all.retain(|source| !is_place(&source.path));
        assert_eq!(mentions(&all, &["unsafe {", "unsafe fn", "unsafe impl"]), [""; 0]);
    }
}

#[test]
fn no_source_names_a_place_of_one_machine() {
    for folder in crates().chain(["tests", "scripts"]) {
        for source in sources(&workspace().join(folder)) {
            for place in [concat!("/ho", "me/"), concat!("/ro", "ot/"), concat!("/wo", "rk/")] {
                assert!(!source.text.contains(place), "{} names {place}", source.name());
            }
        }
    }
}
