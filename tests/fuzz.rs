//! Fuzzing of every reader, in this process: sound files are changed by the rules of their formats, read, and taken to
//! the first computation. A reader may refuse a file; it may not panic, take memory beyond measure, or take long.
//!
//! `LF_FUZZ_SECONDS` is the time of each target (default 1), `LF_FUZZ_SEED` the first state of the changes (default 1).
//! `LF_FUZZ_PATIENCE` is the time after which an input counts as one without end (default 30 s).
//! Files that a reader fell over are kept in `tests/fuzz/found` and read first, by every target.
//! `scripts/studies/fuzz` runs for as long as one likes.

#[path = "../lf-core/tests/allocation/mod.rs"]
mod allocation;

mod fuzz {
    pub mod bytes;
    pub mod files;
    pub mod json;
    pub mod random;
    pub mod run;
    pub mod targets;
    pub mod text;
}

use fuzz::{files, run::run, targets};

#[test]
fn volumes() {
    run("volumes", &files::volumes(), files::change_volume, targets::volume);
}

#[test]
fn fields() {
    run("fields", &files::fields(), fuzz::bytes::change, targets::field);
}

#[test]
fn cameras() {
    run("cameras", &files::cameras(), fuzz::json::change, targets::camera);
}

#[test]
fn scenes() {
    run("scenes", &files::scenes(), fuzz::json::change, targets::scene);
}

#[test]
fn particles_and_tables() {
    run("particles", &files::particles(), fuzz::text::change, targets::particles);
}

#[test]
fn tiffs() {
    run("tiffs", &files::tiffs(), fuzz::bytes::change, targets::image);
}

#[test]
fn pngs() {
    run("pngs", &files::pngs(), files::change_png, targets::image);
}

#[test]
fn exr_frames() {
    run("exrs", &files::exrs(), fuzz::bytes::change, targets::image);
}

#[test]
fn other_texts() {
    run("texts", &files::texts(), fuzz::text::change, targets::text);
}
