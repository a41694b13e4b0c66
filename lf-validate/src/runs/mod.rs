//! In: JSON that tools wrote about runs: their scores, statistics and settings.
//! Out: one flat record a run, curves over seeds, and the trade of cost against error.
//! Open first: `record.rs`.

mod condition;
pub mod curves;
mod join;
mod median_range;
mod missing;
mod record;
pub mod trade;
mod values;

pub use condition::{Condition, select};
pub use join::{Argument, Entries, join};
pub use median_range::MedianRange;
pub use missing::MissingKeys;
pub use record::{RunRecord, read_records};
pub use values::{is_same, order, parse_value, plain};
