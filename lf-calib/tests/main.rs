//! Tests of lf-calib: its library on images whose answer is known, and its command line.

mod cli;
mod cli_nominal;
mod cli_target;
mod frames;
mod hard;
mod known;
mod metamorphic;
mod refusals;
mod scenes;
mod setup_mistakes;
mod stop;
mod volume;
mod workbench;
