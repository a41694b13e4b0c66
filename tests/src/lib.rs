//! What the tests of whole tools share: finding and running the tools, inputs they accept, and ways to use them.

pub mod samples;
pub mod tools;
pub mod uses;
