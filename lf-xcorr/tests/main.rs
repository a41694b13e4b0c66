//! Tests of lf-xcorr: its library on clouds of particles whose displacement is known, and its command line.

mod accuracy;
mod cli;
mod coverage;
mod extremes;
mod laws;
mod options;
mod pairs;
mod parts;
mod scene;
mod tracked;
mod uncertainty;
mod windows;
mod workbench;
