//! The tool in a folder, and refusals that leave no output.

use lf_tests::Workbench;

/// The tool in an empty folder.
pub fn workbench() -> Workbench {
    Workbench::new(env!("CARGO_BIN_EXE_lf-calib"))
}

/// Runs a line that must be refused with exactly this message and leave no output `out` or `out.exr`.
pub fn refused(bench: &Workbench, line: &str, message: &str) {
    bench.run(line).refused_with(message);
    assert!(!bench.path("out").exists() && !bench.path("out.exr").exists(), "{line}");
}
