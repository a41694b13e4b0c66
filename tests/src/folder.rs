//! The folder of a test: its files, and tools run in it.

use crate::call::{Call, Ended};
use lf_core::{Grid, image, volume};
use ndarray::Array2;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// A new, empty folder, which is removed at the end.
#[derive(Debug)]
pub struct Folder(TempDir);

impl Folder {
    /// A folder that is removed when it is dropped.
    #[expect(clippy::new_without_default, reason = "it makes a folder on disk")]
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder for the test"))
    }

    /// A folder for a static, which is never dropped. It is removed when this process ends.
    pub fn shared() -> Self {
        let folder = Self::new();
        let mut remover = Command::new("sh");
        remover.args(["-c", "cat; rm -rf \"$0\""]).arg(folder.root()).stdin(Stdio::piped()).stdout(Stdio::null());
        // The end of this process closes the pipe, and `cat` ends.
        std::mem::forget(remover.spawn().expect("sh starts"));
        folder
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        self.0.path()
    }

    /// Path of a file in the folder.
    pub fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.root().join(name)
    }

    /// Writes a file and returns its path.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        fs::write(self.path(name), content).expect("a file of the test is written");
        self.path(name)
    }

    /// Writes an image and returns its path.
    pub fn image(&self, name: &str, pixels: &Array2<f32>) -> PathBuf {
        image::save(&self.path(name), pixels, &Vec::new()).expect("an image of the test is written");
        self.path(name)
    }

    /// Writes `bright.exr`, the frame `name` with a reflection on a part of it, and `mask.exr`, which is 0 there.
    pub fn reflection(&self, name: &str) {
        let frame = image::open(&self.path(name)).expect("a frame").pixels;
        let peak = frame.fold(0f32, |peak, value| peak.max(*value));
        let (height, width) = frame.dim();
        let is_hidden = |row: usize, column: usize| row < height / 2 && column > width / 3 && column < width / 2;
        let of_mask = |(row, column)| if is_hidden(row, column) { 0.0 } else { 255.0 };
        let of_frame = |(row, column)| if is_hidden(row, column) { 3.0 * peak } else { frame[(row, column)] };
        self.image("mask.exr", &Array2::from_shape_fn(frame.dim(), of_mask));
        self.image("bright.exr", &Array2::from_shape_fn(frame.dim(), of_frame));
    }

    /// Writes a volume and returns its path.
    pub fn volume(&self, name: &str, grid: &Grid, indices: &[u64], columns: &[(&str, &[f32])]) -> PathBuf {
        let mut bytes = Vec::new();
        volume::write(&mut bytes, grid, indices, columns, &Vec::new()).expect("memory is writable");
        self.write(name, bytes)
    }

    /// Reads a file.
    pub fn bytes(&self, name: impl AsRef<Path>) -> Vec<u8> {
        let path = self.path(name);
        fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    /// Reads a text.
    pub fn text(&self, name: impl AsRef<Path>) -> String {
        String::from_utf8(self.bytes(name)).expect("a text is UTF-8")
    }

    /// Reads a JSON file.
    pub fn json(&self, name: impl AsRef<Path>) -> Value {
        serde_json::from_slice(&self.bytes(name)).expect("the file is JSON")
    }

    /// All files in a folder of this folder, or in itself (`.`), with their bytes.
    pub fn files(&self, name: &str) -> BTreeMap<String, Vec<u8>> {
        let entries =
            fs::read_dir(self.path(name)).expect("a folder of the test").map(|entry| entry.expect("an entry"));
        let files = entries.filter(|entry| entry.path().is_file());
        files.map(|entry| (entry.file_name().to_string_lossy().into_owned(), self.bytes(entry.path()))).collect()
    }

    /// A call in this folder. The first word of the line names the tool.
    pub fn call(&self, line: &str) -> Call {
        let (tool, words) = line.split_once(' ').unwrap_or((line, ""));
        Call::new(tool).within(self.root()).words(words.split_whitespace())
    }

    /// Runs a line that must end well.
    pub fn run(&self, line: &str) -> Ended {
        self.call(line).run().done()
    }

    /// Writes a ready scene with keys set as `scene.json`.
    pub fn scene(&self, name: &str, keys: &[impl AsRef<str>]) -> PathBuf {
        let set = keys.iter().flat_map(|key| ["--set", key.as_ref()]);
        let text = Call::new("lf-synth").words(["scene", name]).words(set).run().done().stdout;
        self.write("scene.json", text)
    }
}

/// A folder of a test, and the one tool that is run in it.
#[derive(Debug)]
pub struct Workbench {
    folder: Folder,
    tool: &'static str,
}

impl Deref for Workbench {
    type Target = Folder;

    fn deref(&self) -> &Folder {
        &self.folder
    }
}

impl Workbench {
    /// An empty folder. `tool` is the path of the program, `env!("CARGO_BIN_EXE_...")`.
    pub fn new(tool: &'static str) -> Self {
        Self { folder: Folder::new(), tool }
    }

    /// A call of the tool in the folder.
    pub fn call<W: Words + ?Sized>(&self, words: &W) -> Call {
        Call::new(self.tool).within(self.root()).words(words.words())
    }

    /// Runs the tool.
    pub fn run<W: Words + ?Sized>(&self, words: &W) -> Ended {
        self.call(words).run()
    }

    /// Runs the tool with bytes on standard input.
    pub fn feed<W: Words + ?Sized>(&self, words: &W, input: impl Into<Vec<u8>>) -> Ended {
        self.call(words).pipe(input.into()).run()
    }

    /// Runs the tool, which must end well.
    pub fn done<W: Words + ?Sized>(&self, words: &W) -> Ended {
        self.run(words).done()
    }

    /// Runs the tool, which must refuse its work in one line that has all of `named`.
    pub fn refused<W: Words + ?Sized>(&self, words: &W, named: &[&str]) {
        let ended = self.run(words).refused("");
        named.iter().for_each(|text| assert!(ended.stderr.contains(text), "{text:?} is not in {}", ended.stderr));
    }
}

/// The arguments of a call: a line of words between spaces, or a list of words.
pub trait Words {
    /// The words.
    fn words(&self) -> Vec<&str>;
}

impl Words for str {
    fn words(&self) -> Vec<&str> {
        self.split_whitespace().collect()
    }
}

impl Words for String {
    fn words(&self) -> Vec<&str> {
        self.as_str().words()
    }
}

impl Words for [&str] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl<const N: usize> Words for [&str; N] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl Words for Vec<&str> {
    fn words(&self) -> Vec<&str> {
        self.clone()
    }
}
