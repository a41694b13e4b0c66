//! Black-box tests of lf-fit: particles of a scene of lf-synth found again, and its command line.

mod particles;
