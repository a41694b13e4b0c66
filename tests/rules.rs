//! The rules of the house, read off the sources.

mod house;
mod links;
mod sources;
mod walls;
mod words;
