//! Helpers for tests of scripts.

use crate::tools::{TOOLS, path};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output};

/// Whether all programs are installed; says which is missing. `make` must be GNU make.
pub fn has_programs(programs: &[&str]) -> bool {
    let is_there = |program: &str| {
        let output = Command::new(program).arg("--version").output();
        output.is_ok_and(|output| program != "make" || output.stdout.starts_with(b"GNU Make"))
    };
    let missing: Vec<&str> = programs.iter().copied().filter(|program| !is_there(program)).collect();
    missing.iter().for_each(|program| eprintln!("{program} is not installed: not tested"));
    missing.is_empty()
}

/// Links all tools into a new folder.
pub fn link_tools(folder: &Path) {
    fs::create_dir(folder).expect("a folder of the test");
    TOOLS.iter().for_each(|tool| symlink(path(tool), folder.join(tool)).expect("a link of the test"));
}

/// Standard output and standard error as text.
pub fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}
