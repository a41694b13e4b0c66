//! In: records of runs, and the keys of cost, error and memory.
//! Out: one setting a name, the Pareto front among them, and the effect of each factor.
//! Open first: `settings.rs`.

mod chart;
mod pareto;
mod settings;

pub use chart::ChartOptions;
pub use pareto::{Pareto, pareto};
pub use settings::{Ask, Effect, Factor, Setting, Trade, trade};
