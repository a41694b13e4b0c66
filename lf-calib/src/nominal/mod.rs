//! A camera by its data sheets, before it has seen anything.
//!
//! In: lengths and f-numbers of the data sheets, and the liquid that the camera looks into. Out: a camera, which of its
//! parts do not fit, and what an experiment should know of it.
//! Open first: `data_sheet.rs`; `advice.rs` derives depths, `sheet.rs` the best of them, and
//! `warnings.rs` compares the parts.

mod advice;
pub(crate) mod data_sheet;
mod sheet;
mod warnings;

pub use advice::{Advice, advice};
pub use data_sheet::{DataSheet, Liquid, in_air};
pub use sheet::{LightSheet, light_sheet};
pub use warnings::sheet_warnings;
