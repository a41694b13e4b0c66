//! Tests of lf-validate: its command line.

mod cli;
mod common;
mod curves;
mod trade;
mod volumes;
