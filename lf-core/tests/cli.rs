//! The shared part of the command lines. This program runs itself as a tool and checks what a user would see.

use clap::Parser;
use lf_core::cli::{self, Common};
use lf_core::{Error, Result, Session, Verdict, io};
use serde_json::Value;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Output, Stdio};

/// Variable that makes this program the tool.
const TOOL: &str = "LF_TEST_TOOL";

/// A tool that does as asked
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(flatten)]
    common: Common,
    /// The action
    action: String,
    /// The input
    #[arg(default_value = "-")]
    input: PathBuf,
    /// The output
    #[arg(short, default_value = "-")]
    output: PathBuf,
    /// A number that only an experiment changes
    #[arg(long, value_name = "N", default_value_t = 3, help_heading = "For experiments", hide = true)]
    trial: usize,
}

fn tool() -> ExitCode {
    cli::run("lf-tool", |arguments: &Arguments| &arguments.common, act)
}

fn act(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    session.say("said");
    session.explain("explained");
    match arguments.action.as_str() {
        "no" => return Ok(Verdict::No),
        "fail" => return Err(Error::new("a\nb.exr", "two lines", "wanted one")),
        "panic" => panic!("the floor\ngave way"),
        "deep" => (0..100).for_each(|i| {
            rayon::join(|| assert!(i < 50, "step {i} of a worker"), || ());
        }),
        "warn" => session.warn("thin ice"),
        "history" => {
            let history = session.history(&Vec::new());
            io::save_text(Path::new("-"), |out| write!(out, "{}", serde_json::to_string(&history)?))?;
        }
        "count" => {
            session.count("voxels", 7);
            session.count("voxels", 8);
            let progress = session.progress("counting", 10);
            session.phase("read", |session| {
                session.phase("check", |_| Ok(()))?;
                progress.add(10);
                Ok(())
            })?;
            session.phase("read", |_| Ok(()))?;
        }
        "println" => print!("left in the buffer"),
        "copy" => {
            session.keep_apart(&arguments.output, &[&arguments.input])?;
            let bytes = io::open(&arguments.input)?;
            session.explain(format!("mapped: {}", bytes.is_mapped()));
            io::save(&arguments.output, |out| out.write_all(&bytes))?;
        }
        "wait" => {
            let bytes = io::open(&arguments.input)?;
            eprintln!("ready");
            std::io::stdin().read_line(&mut String::new()).unwrap();
            let sum: u64 = bytes.iter().map(|byte| u64::from(*byte)).sum();
            io::save_text(&arguments.output, |out| writeln!(out, "{sum}"))?;
        }
        other => return Err(Error::new("action", other, "wanted another")),
    }
    Ok(Verdict::Done)
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(arguments).env(TOOL, "yes").env_remove("LF_HISTORY").stdin(Stdio::null());
    command
}

fn run(arguments: &[&str]) -> (i32, String, String) {
    seen(command(arguments).output().unwrap())
}

fn seen(output: Output) -> (i32, String, String) {
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// Refused with exactly this line.
fn refused(arguments: &[&str], line: &str) {
    assert_eq!(run(arguments), (2, String::new(), format!("lf-tool: {line}\n")), "{arguments:?}");
}

fn help_and_version_are_results() {
    let (code, out, err) = run(&["--help"]);
    assert!(code == 0 && err.is_empty() && out.contains("Common options:") && out.contains("--threads <N>"), "{out}");
    let (code, out, err) = run(&["--version"]);
    assert!(code == 0 && err.is_empty() && out.trim().ends_with(env!("CARGO_PKG_VERSION")), "{out}");
    let full = command(&["--help"]).stdout(File::create("/dev/full").unwrap()).output().unwrap();
    let line = "lf-tool: standard output: no space left on device; wanted room for the whole output\n";
    assert_eq!(seen(full), (2, String::new(), line.into()));
}

fn help_all_shows_what_help_hides() {
    let mention = "--help-all prints this help with the options for experiments.";
    for short in ["--help", "-h"] {
        let (code, out, _) = run(&[short]);
        assert!(code == 0 && !out.contains("--trial") && out.lines().last() == Some(mention), "{out}");
    }
    for words in [&["--help-all"][..], &["no", "--help-all", "-q"]] {
        let (code, out, err) = run(words);
        assert!(
            code == 0 && err.is_empty() && out.contains("For experiments:") && out.contains("--trial <N>"),
            "{out}"
        );
        assert!(out.contains("Print errors only") && !out.contains(mention), "{out}");
    }
    for words in [["--generate", "man"], ["--generate", "bash"]] {
        let (code, out, _) = run(&words);
        assert!(code == 0 && out.replace('\\', "").contains("--trial") && !out.contains(mention), "{out}");
    }
    assert_eq!(run(&["no", "-q", "--trial", "4"]).0, 1);
    assert_eq!(run(&["no", "-q", "--", "--help-all"]).0, 1);
}

fn a_mistake_is_one_line() {
    refused(&[], "the following required arguments were not provided: <ACTION>; see 'lf-tool --help'");
    refused(
        &["no", "--threads", "x"],
        "invalid value 'x' for '--threads <N>': wanted a whole number of 0 or more; see 'lf-tool --help'",
    );
    refused(&["no", "--threads", "1025"], "--threads: 1025; wanted at most 1024; see 'lf-tool --help'");
    refused(
        &["no", "--threads", "-1,2"],
        "--threads: -1,2; wanted a number that is not negative; see 'lf-tool --help'",
    );
    refused(&["no", "--threads", "-1"], "--threads: -1; wanted a number that is not negative; see 'lf-tool --help'");
    let (code, _, err) = run(&["no", "--quiet", "-1"]);
    assert!(code == 2 && err.starts_with("lf-tool: unexpected argument '-1' found"), "{err}");
    let (code, _, err) = run(&["no", "--stat", "x"]);
    assert_eq!((code, err.lines().count()), (2, 1), "{err}");
    assert!(err.contains("unexpected argument '--stat' found (a similar argument exists: '--stats')"), "{err}");
}

fn outcomes_have_their_codes() {
    assert_eq!(run(&["no", "-q"]), (1, String::new(), String::new()));
    assert_eq!(run(&["warn"]), (0, String::new(), "lf-tool: said\nlf-tool: warning: thin ice\n".into()));
    assert_eq!(run(&["no", "-v"]), (1, String::new(), "lf-tool: said\nlf-tool: explained\n".into()));
    refused(&["fail", "-q"], "a b.exr: two lines; wanted one");
}

fn a_panic_is_one_line() {
    let (code, out, err) = run(&["panic", "-q"]);
    assert!(code == 2 && out.is_empty() && err.lines().count() == 1, "{err}");
    let start = "lf-tool: internal error: the floor gave way (";
    assert!(err.starts_with(start) && err.contains("cli.rs:") && err.ends_with("; please report it\n"), "{err}");
    let (code, _, err) = run(&["deep", "-q", "--threads", "3"]);
    assert!(code == 2 && err.lines().count() == 1 && err.contains("step 50 of a worker"), "{err}");
}

fn history_can_be_left_out() {
    let (_, out, _) = run(&["history", "--threads", "2"]);
    let history: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(history[0]["tool"], "lf-tool");
    assert_eq!(history[0]["arguments"], serde_json::json!(["history", "--threads", "2"]));
    let output = command(&["history"]).env("LF_HISTORY", "off").output().unwrap();
    assert_eq!(output.stdout, b"[]");
}

fn stats_are_written_whatever_the_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stats.json");
    let name = path.to_str().unwrap();
    assert_eq!(run(&["count", "-q", "--threads", "3", "--stats", name]), (0, String::new(), String::new()));
    let stats: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    assert_eq!(stats["tool"], "lf-tool");
    assert_eq!(stats["threads"], 3);
    assert_eq!(stats["counts"], serde_json::json!({"voxels": 8}));
    let phases: Vec<&String> = stats["phases"].as_object().unwrap().keys().collect();
    assert_eq!(phases, ["read", "check"]);
    assert!(stats["seconds"].as_f64().unwrap() > 0.0 && stats["peak_bytes"].as_u64().unwrap() > 100_000);
    fs::remove_file(&path).unwrap();
    assert_eq!(run(&["no", "-q", "--stats", name]).0, 1);
    assert!(path.exists());
    refused(
        &["no", "-q", "--stats", "/dev/full"],
        "/dev/full: no space left on device; wanted room for the whole output",
    );
}

fn bytes_come_by_name_redirect_and_pipe() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("input");
    fs::write(&path, "0123456789").unwrap();
    let by_name = command(&["copy", "-v", path.to_str().unwrap()]).output().unwrap();
    let redirected = command(&["copy", "-v"]).stdin(File::open(&path).unwrap()).output().unwrap();
    let (reader, mut writer) = std::io::pipe().unwrap();
    writer.write_all(b"0123456789").unwrap();
    drop(writer);
    let piped = command(&["copy", "-v"]).stdin(reader).output().unwrap();
    for (output, mapped) in [(by_name, true), (redirected, true), (piped, false)] {
        assert_eq!(output.stdout, b"0123456789");
        assert!(String::from_utf8(output.stderr).unwrap().contains(&format!("mapped: {mapped}")));
    }
    // Another process has read four bytes before us.
    let mut file = File::open(&path).unwrap();
    std::io::Seek::seek(&mut file, std::io::SeekFrom::Start(4)).unwrap();
    assert_eq!(command(&["copy"]).stdin(file).output().unwrap().stdout, b"456789");
    let folder = command(&["copy", "-q"]).stdin(File::open(folder.path()).unwrap()).output().unwrap();
    assert_eq!(seen(folder).2, "lf-tool: standard input: is a folder; wanted a file to read\n");
}

fn a_lost_output_is_noticed() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = command(&["history", "-q"]).stdout(writer).output().unwrap();
    let line = "lf-tool: standard output: closed by its reader before the end; wanted a reader that takes everything\n";
    assert_eq!(seen(output), (2, String::new(), line.into()));
    let output = command(&["println", "-q"]).stdout(File::create("/dev/full").unwrap()).output().unwrap();
    let line = "lf-tool: standard output: no space left on device; wanted room for the whole output\n";
    assert_eq!(seen(output), (2, String::new(), line.into()));
}

fn outputs_and_inputs_stay_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    fs::write(&path, "precious").unwrap();
    let name = path.to_str().unwrap();
    let wanted = "wanted another file to write to";
    refused(&["copy", "-q", name, "-o", name], &format!("{name}: is also an input; {wanted}"));
    refused(&["copy", "-q", name, "--stats", name], &format!("{name}: is an input and the --stats file; {wanted}"));
    let new = folder.path().join("b");
    let new = new.to_str().unwrap();
    refused(
        &["copy", "-q", name, "-o", new, "--stats", new],
        &format!("{new}: is the output and the --stats file; {wanted}"),
    );
    let appended = File::options().append(true).open(&path).unwrap();
    let output = command(&["copy", "-q", name]).stdout(appended).output().unwrap();
    assert_eq!(seen(output).2, format!("lf-tool: standard output: is also an input; {wanted}\n"));
    assert_eq!(fs::read(&path).unwrap(), b"precious");
}

fn threads_of_the_environment_have_the_same_limit() {
    let counted =
        |threads: &str, words: &[&str]| seen(command(words).env("RAYON_NUM_THREADS", threads).output().unwrap());
    let line = "lf-tool: RAYON_NUM_THREADS: 70000; wanted at most 1024; see 'lf-tool --help'\n";
    assert_eq!(counted("70000", &["no", "-q"]), (2, String::new(), line.into()));
    assert_eq!(counted("70000", &["no", "-q", "--threads", "2"]), (1, String::new(), String::new()));
    assert_eq!(counted("many", &["no", "-q"]), (1, String::new(), String::new()));
}

fn a_message_has_an_end() {
    let (code, out, err) = run(&[&"x".repeat(100_000), "-q"]);
    assert!(code == 2 && out.is_empty() && err.chars().count() <= 1001, "{}", err.len());
    assert!(err.starts_with("lf-tool: action: xxx") && err.ends_with("xxx; wanted another\n"), "{err}");
    let (_, _, err) = run(&["no", "-q", &format!("--{}", "y".repeat(100_000))]);
    assert!(err.chars().count() <= 1001 && err.starts_with("lf-tool: unexpected argument '--yyy"), "{err}");
}

/// Runs words of this program in a shell; `{}` in the line stands for the program and the words.
fn shell(line: &str, words: &[&str]) -> Output {
    let line = line.replace("{}", "\"$0\" \"$@\"");
    let mut shell = Command::new("sh");
    shell.args(["-c", &line]).arg(std::env::current_exe().unwrap()).args(words).env(TOOL, "yes");
    shell.env("LF_HISTORY", "off").stdin(Stdio::null()).output().unwrap()
}

fn a_closed_standard_output_is_noticed() {
    let line = "lf-tool: standard output: closed; wanted a place to write\n";
    for words in [&["history", "-q"][..], &["--help"], &["--version"], &["--generate", "bash"]] {
        assert_eq!(seen(shell("{} >&-", words)), (2, String::new(), line.into()), "{words:?}");
        assert_eq!(seen(shell("{} >/dev/null", words)).0, 0, "{words:?}");
    }
    // Who writes nothing there needs none.
    assert_eq!(seen(shell("{} >&-", &["no", "-q"])), (1, String::new(), String::new()));
}

fn a_limit_of_file_sizes_is_an_error_of_the_write() {
    let folder = tempfile::tempdir().unwrap();
    let [input, output] = ["input", "output"].map(|name| folder.path().join(name));
    fs::write(&input, vec![7; 1 << 20]).unwrap();
    let words = ["copy", "-q", input.to_str().unwrap(), "-o", output.to_str().unwrap()];
    let line = format!("lf-tool: {}: file too large; wanted room for the whole output\n", output.display());
    assert_eq!(seen(shell("ulimit -f 100; {}", &words)), (2, String::new(), line));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    assert_eq!(seen(shell("ulimit -f 4000; {}", &words)), (0, String::new(), String::new()));
}

/// Starts a tool that holds `input` mapped, changes the file, and lets the tool read it.
fn read_after(input: &Path, output: &Path, change: impl FnOnce()) -> (i32, String, String) {
    let mut command = command(&["wait", "-q", input.to_str().unwrap(), "-o", output.to_str().unwrap()]);
    let command = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut ready = [0; 6];
    child.stderr.as_mut().unwrap().read_exact(&mut ready).unwrap();
    change();
    child.stdin.take().unwrap().write_all(b"\n").unwrap();
    seen(child.wait_with_output().unwrap())
}

fn inputs_that_change_are_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let [input, output] = ["input", "output"].map(|name| folder.path().join(name));
    let wanted = "wanted a file that stays as it is during the run";
    fs::write(&input, vec![1; 1 << 20]).unwrap();
    // Only Unix reports the loss of a mapped input.
    let cut = || File::options().write(true).open(&input).unwrap().set_len(10_000).unwrap();
    let line = format!("lf-tool: {}: cut short while it was read; {wanted}\n", input.display());
    assert!(cfg!(feature = "portable") || read_after(&input, &output, cut) == (2, String::new(), line));
    fs::write(&input, vec![1; 1 << 20]).unwrap();
    let overwrite = || File::options().append(true).open(&input).unwrap().write_all(b"more").unwrap();
    let line = format!("lf-tool: {}: changed while it was read; {wanted}\n", input.display());
    assert_eq!(read_after(&input, &output, overwrite), (2, String::new(), line.clone()));
    assert_eq!(read_after(&input, Path::new("-"), overwrite), (2, format!("{}\n", (1 << 20) + 435), line));
    assert!(!output.exists());
    // A file that replaces the input leaves its content to those that read it.
    fs::write(&input, vec![1; 1 << 20]).unwrap();
    let replace = || {
        fs::write(folder.path().join("new"), "another").unwrap();
        fs::rename(folder.path().join("new"), &input).unwrap();
    };
    assert_eq!(read_after(&input, &output, replace), (0, String::new(), String::new()));
    assert_eq!(fs::read_to_string(&output).unwrap(), format!("{}\n", 1 << 20));
}

fn places_are_tried_before_the_work() {
    // Nobody can make a file there.
    let (code, out, err) = run(&["no", "-q", "--stats", "/proc/stats.json"]);
    assert!(code == 2 && out.is_empty() && err.starts_with("lf-tool: /proc/stats.json: "), "{err}");
    let folder = tempfile::tempdir().unwrap();
    let stats = folder.path().join("stats.json");
    assert_eq!(run(&["fail", "-q", "--stats", stats.to_str().unwrap()]).0, 2);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

fn main() -> ExitCode {
    if std::env::var_os(TOOL).is_some() {
        return tool();
    }
    let tests: [(&str, fn()); 16] = [
        ("help_and_version_are_results", help_and_version_are_results),
        ("help_all_shows_what_help_hides", help_all_shows_what_help_hides),
        ("a_mistake_is_one_line", a_mistake_is_one_line),
        ("outcomes_have_their_codes", outcomes_have_their_codes),
        ("a_panic_is_one_line", a_panic_is_one_line),
        ("history_can_be_left_out", history_can_be_left_out),
        ("stats_are_written_whatever_the_verdict", stats_are_written_whatever_the_verdict),
        ("bytes_come_by_name_redirect_and_pipe", bytes_come_by_name_redirect_and_pipe),
        ("a_lost_output_is_noticed", a_lost_output_is_noticed),
        ("outputs_and_inputs_stay_apart", outputs_and_inputs_stay_apart),
        ("threads_of_the_environment_have_the_same_limit", threads_of_the_environment_have_the_same_limit),
        ("a_message_has_an_end", a_message_has_an_end),
        ("a_closed_standard_output_is_noticed", a_closed_standard_output_is_noticed),
        ("a_limit_of_file_sizes_is_an_error_of_the_write", a_limit_of_file_sizes_is_an_error_of_the_write),
        ("inputs_that_change_are_noticed", inputs_that_change_are_noticed),
        ("places_are_tried_before_the_work", places_are_tried_before_the_work),
    ];
    // A standard stream is a file, and faults are reported, on Unix only.
    let of_unix: &[&str] = if cfg!(feature = "portable") {
        &[
            "bytes_come_by_name_redirect_and_pipe",
            "outputs_and_inputs_stay_apart",
            "a_closed_standard_output_is_noticed",
            "a_limit_of_file_sizes_is_an_error_of_the_write",
        ]
    } else {
        &[]
    };
    let mut failed = false;
    for (name, test) in tests.into_iter().filter(|(name, _)| !of_unix.contains(name)) {
        let passed = std::panic::catch_unwind(test).is_ok();
        println!("test {name} ... {}", if passed { "ok" } else { "FAILED" });
        failed |= !passed;
    }
    ExitCode::from(u8::from(failed) * 101)
}
