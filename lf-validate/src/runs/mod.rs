//! In: JSON that tools wrote about runs: their scores, statistics and settings.
//! Out: one flat record a run, curves over seeds, and the trade of cost against error.
//! Open first: `record.rs`.

pub mod curves;
mod join;
mod record;
pub mod trade;
mod values;

pub use join::{Argument, Entries, join};
pub use record::{Condition, RunRecord, read_records, select};
pub use values::parse_value;
