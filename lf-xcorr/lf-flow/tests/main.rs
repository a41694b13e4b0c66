//! Black-box tests of lf-flow: files in, files out.

mod fields;
