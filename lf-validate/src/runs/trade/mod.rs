//! In: records of runs, and the keys of cost, error and memory.
//! Out: one setting a name, the Pareto front among them, and the effect of each factor.
//! Open first: `compare.rs`.

mod chart;
mod compare;
mod pareto;
mod settings;

pub use chart::ChartOptions;
pub use compare::trade;
pub use settings::{Trade, TradeKeys};
