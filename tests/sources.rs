//! The sources that the rules are about.

use lf_tests::tools::{TOOLS, workspace};
use std::fs;
use std::path::{Path, PathBuf};

/// Package and folder of the example of a stage of one's own. It keeps the same rules as a tool.
pub const EXAMPLE: (&str, &str) = ("lf-refocus", "scripts/examples/refocus");

/// The libraries that tools share.
pub const LIBRARIES: [&str; 2] = ["lf-core", "lf-plot"];

/// The folder of a package. A tool that was added later stands in the folder of its nearest one.
pub fn folder(package: &str) -> &str {
    match package {
        "lf-plot" => "lf-core/lf-plot",
        "lf-fit" => "lf-mart/lf-fit",
        "lf-flow" => "lf-xcorr/lf-flow",
        name if name == EXAMPLE.0 => EXAMPLE.1,
        name => name,
    }
}

/// Folders of the crates with a library.
pub fn crates() -> impl Iterator<Item = &'static str> {
    TOOLS.into_iter().chain(LIBRARIES).chain([EXAMPLE.0]).map(folder)
}

/// Folders of the crates with a command line.
pub fn tools() -> impl Iterator<Item = &'static str> {
    TOOLS.into_iter().chain([EXAMPLE.0]).map(folder)
}

/// A Rust source.
pub struct Source {
    pub path: PathBuf,
    pub text: String,
}

impl Source {
    /// Its path from the workspace.
    pub fn name(&self) -> String {
        self.path.strip_prefix(workspace()).unwrap_or(&self.path).display().to_string()
    }

    /// The modules that it declares without `pub`.
    pub fn modules(&self) -> Vec<String> {
        let modules = self.text.lines().filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(';'));
        modules.map(str::to_owned).collect()
    }
}

/// Every Rust source under a folder. Empty if there is no such folder.
pub fn sources(folder: &Path) -> Vec<Source> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            found.push(Source { path, text });
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

/// All Rust sources of the project: of the crates, their tests and benches, and of this package.
pub fn all_sources() -> Vec<Source> {
    let folders =
        crates().flat_map(|folder| ["src", "tests", "benches"].map(|part| workspace().join(folder).join(part)));
    folders.chain([workspace().join("tests")]).flat_map(|folder| sources(&folder)).collect()
}
