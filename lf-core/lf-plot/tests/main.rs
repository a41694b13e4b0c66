//! Tests of the charts.

mod charts;
