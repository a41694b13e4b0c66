//! JSON written by people: all mistakes are reported at once, each with its remedy.
//!
//! In: a JSON value and the type it should become. Out: the type, or a phrase that names all missing, unknown and wrong
//! keys. The types say which keys exist; nothing is listed twice.
//! Open first: `read.rs`; `reader.rs` is the deserializer behind it, and `suggest.rs` knows synonyms.

mod fault;
mod read;
mod reader;
mod suggest;

pub(crate) use read::is_zero;
pub use read::{mistakes, read};
