//! Tests of lf-validate: its command line.

mod cli;
mod curves;
mod ensemble;
mod export;
mod report;
mod trade;
mod volumes;
mod workbench;
