//! Tests of lf-synth.

mod known;
