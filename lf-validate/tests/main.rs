//! Tests of lf-validate: its command line, and its charts.

mod cli;
mod common;
mod curves;
mod plot;
mod trade;
mod volumes;
