//! The rules of the house, read off the sources.

mod sources;
mod walls;
