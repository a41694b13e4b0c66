//! Runs a tool and checks how it ended.

use crate::tools;
use serde_json::Value;
use std::ffi::OsStr;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::thread;

/// One run of a tool, before it starts. By default history is off and standard input is empty.
pub struct Call {
    tool: String,
    command: Command,
    input: Option<Vec<u8>>,
}

impl Call {
    /// A call without arguments of a tool, by its name or by the path of its program.
    pub fn new(tool: &str) -> Self {
        let program = if tool.contains('/') { PathBuf::from(tool) } else { tools::path(tool) };
        let name = program.file_name().expect("a program has a name").to_string_lossy().into_owned();
        let mut command = Command::new(program);
        command.env("LF_HISTORY", "off").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self { tool: name, command, input: None }
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

    /// Keeps the history of the run in its outputs.
    pub fn with_history(mut self) -> Self {
        self.command.env_remove("LF_HISTORY");
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
            // A tool may refuse its input early and close the pipe.
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
            stderr: without_progress(&String::from_utf8(output.stderr).expect("messages are UTF-8")),
        }
    }
}

/// The messages without lines of progress, which depend on the speed of the machine.
fn without_progress(messages: &str) -> String {
    messages.split_inclusive('\n').filter(|line| !line.contains(": progress: ")).collect()
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

    /// Asserts that the run ended with this exit code.
    pub fn ended(self, code: i32) -> Self {
        assert_eq!(self.status.code(), Some(code), "{}\n{}", self.call, self.stderr);
        self
    }

    /// Asserts that nothing was said on standard error.
    pub fn silent(self) -> Self {
        assert!(self.stderr.is_empty(), "{}\n{}", self.call, self.stderr);
        self
    }

    /// Standard output as text.
    pub fn text(&self) -> String {
        String::from_utf8(self.stdout.clone()).unwrap_or_else(|error| panic!("{error}\n{}", self.call))
    }

    /// Standard output as JSON.
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.stdout).unwrap_or_else(|error| panic!("{error}\n{}\n{}", self.call, self.stderr))
    }

    /// Standard output as JSON, of a run that ended well and said nothing.
    pub fn silent_json(&self) -> Value {
        assert!(self.status.success() && self.stderr.is_empty(), "{}\n{}\n{}", self.call, self.status, self.stderr);
        self.json()
    }

    /// The line of a refusal; see [`refused`](Self::refused).
    pub fn refusal(self) -> String {
        self.refused("").stderr
    }

    /// Asserts a refusal with exactly this message, which the tool's name precedes.
    pub fn refused_with(self, message: &str) -> Self {
        let ended = self.refused("");
        assert_eq!(ended.stderr, format!("{}: {message}\n", ended.tool), "{}", ended.call);
        ended
    }

    /// Asserts a refusal: exit code 2, nothing on standard output and, besides warnings, one line on standard error. It
    /// begins with the tool's name and names `subject`.
    pub fn refused(self, subject: &str) -> Self {
        let case = format!("{}\n{}\n{}", self.call, self.status, self.stderr);
        assert_eq!(self.status.code(), Some(2), "{case}");
        assert!(self.stdout.is_empty(), "{case}");
        let warning = format!("{}: warning: ", self.tool);
        let lines: Vec<&str> = self.stderr.lines().filter(|line| !line.starts_with(&warning)).collect();
        assert_eq!(lines.len(), 1, "{case}");
        assert!(lines[0].starts_with(&format!("{}: ", self.tool)), "{case}");
        assert!(lines[0].contains(subject), "{subject} is not named\n{case}");
        assert!(!self.stderr.contains("internal error"), "{case}");
        self
    }
}
