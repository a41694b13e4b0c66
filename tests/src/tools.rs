//! Finding the tools, running them, and judging how they ended.
//!
//! `LF_TOOLS=DIR` takes the tools from a folder, an installed or a release build; without it they are built in the
//! profile of the test itself, so that a test never judges a tool of yesterday.

use std::env;
use std::ffi::OsStr;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::thread;

/// The six tools.
pub const TOOLS: [&str; 6] = ["lf-synth", "lf-calib", "lf-prune", "lf-mart", "lf-xcorr", "lf-validate"];

/// The folder of the workspace.
pub fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests stand in the workspace")
}

/// The program that `cargo` was.
pub fn cargo() -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(workspace());
    command
}

/// Path of a tool, built on the first call of a process.
pub fn path(tool: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| env::var_os("LF_TOOLS").map_or_else(build, PathBuf::from));
    let path = folder.join(tool);
    assert!(path.is_file(), "{} is not there", path.display());
    path
}

/// Builds every tool and returns their folder, TARGET/PROFILE: a test runs from TARGET/PROFILE/deps.
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

/// One run of a tool, being put together. History is off and standard input empty unless said otherwise.
pub struct Call {
    tool: String,
    command: Command,
    input: Option<Vec<u8>>,
}

impl Call {
    /// A call without arguments.
    pub fn new(tool: &str) -> Self {
        let mut command = Command::new(path(tool));
        command.env("LF_HISTORY", "off").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self { tool: tool.into(), command, input: None }
    }

    /// Adds one argument.
    pub fn word(mut self, word: impl AsRef<OsStr>) -> Self {
        self.command.arg(word);
        self
    }

    /// Adds arguments.
    pub fn words<W: AsRef<OsStr>>(mut self, words: impl IntoIterator<Item = W>) -> Self {
        self.command.args(words);
        self
    }

    /// Sets a variable of the environment.
    pub fn env(mut self, name: &str, value: &str) -> Self {
        self.command.env(name, value);
        self
    }

    /// Runs in a folder.
    pub fn within(mut self, folder: &Path) -> Self {
        self.command.current_dir(folder);
        self
    }

    /// Pipes bytes into standard input.
    pub fn pipe(mut self, bytes: Vec<u8>) -> Self {
        self.command.stdin(Stdio::piped());
        self.input = Some(bytes);
        self
    }

    /// Standard input from a file, as `<` does.
    pub fn redirect(mut self, path: &Path) -> Self {
        self.command.stdin(File::open(path).expect("an input of the test"));
        self
    }

    /// Standard output to a file or a pipe's end.
    pub fn stdout(mut self, output: impl Into<Stdio>) -> Self {
        self.command.stdout(output);
        self
    }

    /// Standard output to a pipe that its reader has closed.
    pub fn closed_pipe(self) -> Self {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        self.stdout(writer)
    }

    /// Runs to the end.
    pub fn run(mut self) -> Ended {
        let mut child = self.command.spawn().expect("the tool starts");
        let feeder = self.input.take().zip(child.stdin.take()).map(|(bytes, mut stdin)| {
            // A tool that refuses its input early closes the pipe: that is its right.
            thread::spawn(move || drop(stdin.write_all(&bytes)))
        });
        let output = child.wait_with_output().expect("the tool ends");
        if let Some(feeder) = feeder {
            feeder.join().expect("the feeder ends");
        }
        Ended {
            call: format!("{} {:?}", self.tool, self.command.get_args().collect::<Vec<_>>()),
            tool: self.tool,
            status: output.status,
            stdout: output.stdout,
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

/// How a run ended.
#[derive(Debug)]
pub struct Ended {
    call: String,
    tool: String,
    /// Exit code or signal.
    pub status: ExitStatus,
    /// Standard output.
    pub stdout: Vec<u8>,
    /// Standard error.
    pub stderr: String,
}

impl Ended {
    /// Asserts exit code 0.
    pub fn done(self) -> Self {
        assert!(self.status.success(), "{}\n{}\n{}", self.call, self.status, self.stderr);
        self
    }

    /// Asserts the contract of failure: exit code 2, nothing on standard output, and on standard error one line that
    /// begins with the tool's name and names `subject`.
    pub fn refused(self, subject: &str) -> Self {
        let case = format!("{}\n{}\n{}", self.call, self.status, self.stderr);
        assert_eq!(self.status.code(), Some(2), "{case}");
        assert!(self.stdout.is_empty(), "{case}");
        assert_eq!(self.stderr.lines().count(), 1, "{case}");
        assert!(self.stderr.starts_with(&format!("{}: ", self.tool)), "{case}");
        assert!(self.stderr.contains(subject), "{subject} is not named\n{case}");
        assert!(!self.stderr.contains("internal error"), "{case}");
        self
    }
}
