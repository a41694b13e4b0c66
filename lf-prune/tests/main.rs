//! Black-box tests of lf-prune: a rendered scene pruned to its particles, and the command line.

mod support;
