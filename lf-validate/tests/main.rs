//! Tests of lf-validate: its command line.

mod cli;
mod curves;
mod ensemble;
mod trade;
mod volumes;
mod workbench;
