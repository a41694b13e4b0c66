//! Pictures of results: SVG, PNG and PDF.
//!
//! In: a [`Chart`], or shapes put on a [`Drawing`]. [`draw`] turns a chart into a drawing. Out: the text of an SVG, or
//! with [`save`] a file in the format of its name; equal input gives equal bytes. Open `chart.rs` first, then `page.rs`
//! and `drawing.rs`. `slice.rs` lays out a layer of a grid of vectors, `field.rs` one of a field.
//!
//! [`draw`] finds ranges, ticks, keys and margins of a chart. Series differ in colour and in marker, also in grey
//! print. A point that is not finite is left out.
//!
//! Convention: the key above a panel explains its marks; y runs upwards unless its range is given the other way round.

mod arrow;
mod chart;
mod drawing;
mod field;
mod font;
mod key;
mod map;
mod marks;
mod outline;
mod page;
mod palette;
mod panel;
mod pdf;
mod pixels;
mod px_box;
mod range;
mod save;
mod slice;
mod svg;
mod text;
mod ticks;
mod view;

pub use arrow::arrow;
pub use chart::{Arrows, Axis, Chart, Mark, Panel, Place, Style};
pub use drawing::{At, Drawing, Pixel, rounded};
pub use field::{FieldPicture, Scalar, field, layer};
pub use page::{draw, draw_apart};
pub use palette::{COLOURS, Colour, INK, grey};
pub use save::save;
pub use slice::{Slice, usual};
pub use text::{Anchor, NAME_PX, TEXT_PX, short, three_figures};
