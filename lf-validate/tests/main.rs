//! Tests of lf-validate: its command line.

mod cli;
mod ensemble;
mod export;
mod report;
mod score;
mod volumes;
mod workbench;
