//! The rules of the house, read off the sources.

mod house;
mod sources;
mod walls;
mod words;
