//! In: records of runs, and the keys of x, y and the series.
//! Out: one curve a series, the median over its runs with least and greatest value.
//! Open first: `series.rs`.

mod series;

pub use series::{Ask, ChartOptions, Curves, Series, curves};
