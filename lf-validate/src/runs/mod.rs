//! In: JSON that tools wrote about runs, their scores, statistics and settings.
//! Out: one flat record a run, curves over seeds, and the trade of cost against error.
//! Open first: `record.rs`.

pub mod curves;
mod join;
mod record;
pub mod trade;

pub use join::{Part, Word, line};
pub use record::{Condition, Middle, Missing, Record, Refusal, chosen, order, plain, records, same, typed};
