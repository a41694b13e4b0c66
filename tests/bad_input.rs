//! Every input of every tool, spoilt in every way: one line, exit code 2, nothing left behind.

use lf_tests::samples::{DAMAGES, Damage, Kind, SENSOR_PX, Samples};
use lf_tests::uses::{Use, uses};
use ndarray::Array2;
use std::fs;
use std::path::{Path, PathBuf};

/// The output path of a use.
fn output(this: &Use, samples: &Samples) -> PathBuf {
    samples.path(this.output().unwrap_or("unused"))
}

/// Runs a use with `bad` as one input. It must name that file in its refusal and leave nothing behind.
fn refuses(this: &Use, samples: &Samples, slot: usize, bad: &Path) {
    let mut inputs = this.sound(samples);
    inputs[slot] = bad.to_owned();
    let before = samples.listing();
    let name = bad.file_name().and_then(|name| name.to_str()).expect("a name of the test");
    this.call(&inputs, &output(this, samples)).run().refused(name);
    assert_eq!(samples.listing(), before, "{this:?} left something behind");
}

#[test]
fn every_use_works_on_sound_inputs() {
    let samples = Samples::new();
    for this in uses() {
        this.sound_call(&samples, &output(this, &samples)).run().done();
    }
}

#[test]
fn every_spoilt_input_is_refused_by_name() {
    let samples = Samples::new();
    for this in uses() {
        for (slot, kind) in this.inputs().into_iter().enumerate() {
            for damage in DAMAGES {
                if damage != Damage::Stranger || !this.takes_any_kind() {
                    refuses(this, &samples, slot, &samples.spoilt(kind, damage));
                }
            }
        }
    }
}

#[test]
fn a_spoilt_pipe_is_refused_as_standard_input() {
    let samples = Samples::new();
    for this in uses().filter(|this| this.pipes) {
        let kind = this.inputs()[0];
        for damage in [Damage::Empty, Damage::Noise, Damage::Stub, Damage::Half, Damage::LastByte] {
            let mut inputs = this.sound(&samples);
            let bytes = fs::read(samples.spoilt(kind, damage)).unwrap();
            inputs[0] = "-".into();
            let before = samples.listing();
            this.call(&inputs, &output(this, &samples)).pipe(bytes).run().refused("standard input");
            assert_eq!(samples.listing(), before, "{this:?} {damage:?} left something behind");
        }
    }
}

#[test]
fn an_image_of_another_size_than_the_camera_is_refused() {
    let samples = Samples::new();
    let bad = samples.image("bad-size.exr", &Array2::from_elem((SENSOR_PX, SENSOR_PX - 1), 1.0));
    for this in uses().filter(|this| this.inputs().contains(&Kind::Camera)) {
        for (slot, kind) in this.inputs().into_iter().enumerate() {
            if matches!(kind, Kind::Image | Kind::White) {
                refuses(this, &samples, slot, &bad);
            }
        }
    }
}

#[test]
fn pixels_that_are_not_finite_are_refused() {
    let samples = Samples::new();
    for (name, value) in [("bad-nan.exr", f32::NAN), ("bad-infinite.exr", f32::INFINITY)] {
        let bad = samples.frame(name, |x, y| if (x, y) == (30, 70) { value } else { 100.0 });
        for this in uses().filter(|this| !this.takes_any_kind()) {
            for (slot, kind) in this.inputs().into_iter().enumerate() {
                if matches!(kind, Kind::Image | Kind::White) {
                    refuses(this, &samples, slot, &bad);
                }
            }
        }
    }
}

#[test]
fn a_name_with_a_line_break_is_printed_on_one_line() {
    let samples = Samples::new();
    for this in uses() {
        let mut inputs = this.sound(&samples);
        inputs[0] = samples.path("two\nlines\u{1b}[31m");
        this.call(&inputs, &output(this, &samples)).run().refused("lines");
    }
}
