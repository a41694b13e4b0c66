//! Tests of lf-validate: its command line.

mod cli;
mod ensemble;
mod export;
mod report;
mod volumes;
mod workbench;
