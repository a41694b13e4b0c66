//! Whole tools and pipelines, seen from outside.

mod aberrations;
mod bad_input;
mod bad_output;
mod bench;
mod blunders;
mod blur;
mod chain;
mod exports;
mod flowing;
mod frame;
mod front_door;
mod limits;
mod package;
mod pages;
mod paper;
mod physics;
mod presets;
mod routes;
mod scenes;
mod second_stop;
mod swapped;
mod tiles;
mod weather;
