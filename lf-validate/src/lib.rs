//! Result and truth to scores.
//!
//! Slices and fields in, plain structs out; the structs serialise to the JSON that lf-validate prints. Sums are taken in
//! f64 in the order of the data, so a score depends on nothing but its inputs.

pub mod coverage;
pub mod curves;
pub mod depth;
pub mod displacement;
pub mod divergence;
pub mod elongation;
pub mod ensemble;
pub mod info;
pub mod json;
pub mod line;
pub mod noise;
pub mod pdf;
pub mod pictures;
pub mod plot;
pub mod quality;
pub mod runs;
pub mod statistics;
pub mod tracks;
pub mod trade;
pub mod trilinear;
pub mod truth;
pub mod units;
