//! In: records of runs, and the keys of x, y and the series.
//! Out: one curve a series: the median over its runs, with least and greatest value.
//! Open first: `group.rs`.

mod group;
mod series;

pub use group::curves;
pub use series::{ChartOptions, CurveKeys, Curves};
