//! A folder with two volumes, and the tool run in it.
#![allow(dead_code)]

use crate::scene;
use lf_core::grid::Grid;
use lf_core::volume;
use std::fs::File;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

/// A folder with two volumes, and the tool run in it.
pub struct Bench {
    pub folder: tempfile::TempDir,
}

pub const SMALL: [&str; 4] = ["--window", "24,24,12", "--search", "6,6,4"];

impl Bench {
    pub fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        let mut grid = scene::grid([48, 40, 24]);
        grid.spacing_mm = [0.1, 0.1, 0.5];
        let [a, b] = scene::pair(&grid, 10.0 / (24.0 * 24.0 * 12.0), [0.75; 3], 1, |_| [1.3, -0.7, 0.4]);
        bench.save("a.lfv", &a);
        bench.save("b.lfv", &b);
        bench
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn save(&self, name: &str, volume: &scene::Volume) {
        self.write(name, &volume.grid, &volume.indices, &[("intensity", &volume.intensity)]);
    }

    pub fn write(&self, name: &str, grid: &Grid, indices: &[u64], columns: &[(&str, &[f32])]) {
        let mut file = File::create(self.path(name)).unwrap();
        volume::write(&mut file, grid, indices, columns, &Vec::new()).unwrap();
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lf-xcorr"));
        command.args(arguments).current_dir(self.folder.path()).env("LF_HISTORY", "off").stdin(Stdio::null());
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs what must work and answers with standard error.
    pub fn works(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{arguments:?}: {error}");
        error
    }

    /// Runs what must fail: exit code 2, nothing on standard output, one line that starts with the tool's name.
    pub fn fails(&self, arguments: &[&str], words: &[&str]) {
        let output = self.run(arguments);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(output.stdout.is_empty());
        assert!(error.starts_with("lf-xcorr: ") && error.lines().count() == 1, "{arguments:?}: {error}");
        words.iter().for_each(|word| assert!(error.contains(word), "{arguments:?}: {word:?} not in {error}"));
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }
}
