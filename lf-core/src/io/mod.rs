//! Opens files and pipes, and writes whole files or none.
//!
//! In: paths; `-` is standard input or standard output. Out: the bytes of an input, and complete output files.
//! Open first: `input.rs` and `output.rs`.
//!
//! A plain file is mapped, whether it is named or redirected with `<`; everything else is read to its end. Readers see
//! no difference. An output appears under its name when it is complete; until then the old file stays. If an input
//! changes while it is in use, no output appears.

mod bytes;
mod draft;
mod input;
mod names;
mod os;
mod output;
mod watched;

pub use bytes::Bytes;
pub use input::{Signature, open, open_text};
pub use names::{is_standard, name, output_name, same_file, split_page, writing};
pub use os::{guard, release_memory};
pub use output::{check_picture, check_place, save, save_text};
pub use watched::check_inputs;
