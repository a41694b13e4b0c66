//! Finds the tools.
//!
//! `LF_TOOLS=DIR` takes them from a folder, such as an installed or a release build. Without it they are built in the
//! profile of the test, so that a test never judges an old tool.

use std::env;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The tools. Each is a crate of this name.
pub const TOOLS: [&str; 8] =
    ["lf-synth", "lf-calib", "lf-prune", "lf-mart", "lf-fit", "lf-xcorr", "lf-flow", "lf-validate"];

/// The folder of the workspace.
pub fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests stand in the workspace")
}

/// The cargo that runs this test, in the workspace.
pub fn cargo() -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(workspace());
    command
}

/// Path of a tool. The first call of a process builds all tools.
pub fn path(tool: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| env::var_os("LF_TOOLS").map_or_else(build, PathBuf::from));
    let path = folder.join(tool);
    assert!(path.is_file(), "{} is not there", path.display());
    path
}

/// Builds every tool and returns their folder, TARGET/PROFILE. A test runs from TARGET/PROFILE/deps.
fn build() -> PathBuf {
    let test = env::current_exe().expect("a test has a path");
    let folder = test.ancestors().nth(2).expect("a test runs from deps").to_owned();
    let (Some(target), Some(profile)) = (folder.parent(), folder.file_name().and_then(OsStr::to_str)) else {
        panic!("{} is not TARGET/PROFILE", folder.display());
    };
    let profile = if profile == "debug" { "dev" } else { profile };
    let mut command = cargo();
    command.args(["build", "--quiet", "--workspace", "--bins", "--profile", profile, "--target-dir"]).arg(target);
    let built = command.output().expect("cargo runs");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    folder
}
