//! The output of a tool depends only on the bytes of its inputs: not on pipes, threads or earlier runs.

use lf_tests::samples::Samples;
use lf_tests::uses::{Use, uses};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The outcome of a use: standard output, and the bytes of each file of its output.
fn outcome(this: &Use, inputs: &[PathBuf], output: &Path, more: &[&str], stdin: Stdin) -> BTreeMap<String, Vec<u8>> {
    let call = this.call(inputs, output).words(more);
    let call = match stdin {
        Stdin::None => call,
        Stdin::Pipe(path) => call.pipe(fs::read(path).unwrap()),
        Stdin::Redirect(path) => call.redirect(path),
    };
    let ended = call.run().done();
    let mut found = BTreeMap::from([("standard output".to_owned(), ended.stdout)]);
    if output.is_dir() {
        for entry in fs::read_dir(output).unwrap().map(Result::unwrap) {
            found.insert(entry.file_name().to_string_lossy().into_owned(), fs::read(entry.path()).unwrap());
        }
        fs::remove_dir_all(output).unwrap();
    } else if output.exists() {
        found.insert("output".into(), fs::read(output).unwrap());
        fs::remove_file(output).unwrap();
    }
    found
}

enum Stdin<'a> {
    None,
    Pipe(&'a Path),
    Redirect(&'a Path),
}

#[test]
fn file_pipe_and_redirect_give_the_same_bytes() {
    let samples = Samples::new();
    for this in uses().filter(|this| this.pipes) {
        let output = samples.path(this.output().unwrap_or("unused"));
        let sound = this.sound(&samples);
        let named = outcome(this, &sound, &output, &[], Stdin::None);
        let mut inputs = sound.clone();
        inputs[0] = "-".into();
        assert!(named == outcome(this, &inputs, &output, &[], Stdin::Pipe(&sound[0])), "{this:?} by pipe");
        assert!(named == outcome(this, &inputs, &output, &[], Stdin::Redirect(&sound[0])), "{this:?} by redirect");
    }
}

#[test]
fn standard_output_and_a_file_get_the_same_bytes() {
    let samples = Samples::new();
    for this in uses().filter(|this| this.output().is_some() && !this.fills_folder()) {
        let output = samples.path(this.output().unwrap());
        let sound = this.sound(&samples);
        let file = outcome(this, &sound, &output, &[], Stdin::None).remove("output");
        let piped = outcome(this, &sound, Path::new("-"), &[], Stdin::None).remove("standard output");
        assert!(file.is_some() && file == piped, "{this:?}");
    }
}

#[test]
fn threads_and_repetition_change_nothing() {
    let samples = Samples::new();
    for this in uses() {
        let output = samples.path(this.output().unwrap_or("unused"));
        let sound = this.sound(&samples);
        let first = outcome(this, &sound, &output, &["--threads", "1"], Stdin::None);
        for threads in ["1", "2", "4"] {
            let other = outcome(this, &sound, &output, &["--threads", threads], Stdin::None);
            assert!(first == other, "{this:?} with {threads} threads");
        }
    }
}
