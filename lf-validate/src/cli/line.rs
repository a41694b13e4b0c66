//! `line`: settings and scores to one record.

use lf_core::{Refusal, Result, Session, Verdict, io};
use lf_validate::runs::{self, Argument, Entries};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// One run as one line of JSON: its settings, and the JSON that tools wrote about it
///
///   KEY=VALUE  a setting: a number, true or false, or text
///   FILE       JSON of any tool, scores or --stats. Keys of nested objects are joined with dots, as
///              in counts.kept. Lists of numbers stay, other lists are left out
///   NAME:FILE  the same, with `NAME.` before each key
///
/// An argument is a setting if `=` comes before any `:` and `/`. A key given twice is refused.
/// `curves` and `trade` read lines of many runs. For them, name the factors of a study set.KEY, and
/// its seed set.seed.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate line name=a set.seed=1 volume-0000.stats.json quality-0000.json > runs.jsonl
  lf-validate line name=b set.seed=1 volume-0001.stats.json quality-0001.json >> runs.jsonl"
)]
pub struct Arguments {
    /// Settings and files
    #[arg(required = true, value_name = "KEY=VALUE|[NAME:]FILE")]
    words: Vec<String>,
    /// Where the line goes
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

/// Joins settings and files to one record.
pub fn join(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let refused = |refusal: Refusal| refusal.about("arguments");
    let words = arguments.words.iter().map(|word| Argument::parse(word).map_err(refused));
    let words = words.collect::<Result<Vec<Argument>>>()?;
    let file = |word: &Argument<'_>| if let Argument::File(_, file) = word { Some(PathBuf::from(file)) } else { None };
    let files: Vec<PathBuf> = words.iter().filter_map(file).collect();
    session.keep_apart(&arguments.output, &files.iter().map(PathBuf::as_path).collect::<Vec<&Path>>())?;
    io::check_place(&arguments.output)?;
    let read = |word: Argument| match word {
        Argument::Setting(key, value) => Ok(Entries::setting(key, value)),
        Argument::File(name, file) => {
            let source = io::name(Path::new(file));
            let text = io::open_text(Path::new(file))?;
            Entries::scores(&source, name, &text).map_err(|refusal| refusal.about(source))
        }
    };
    let sources = session.phase("read", |_| words.into_iter().map(read).collect::<Result<Vec<Entries>>>())?;
    let record = Value::Object(runs::join(sources).map_err(refused)?);
    io::save_text(&arguments.output, |out| writeln!(out, "{record}"))?;
    Ok(Verdict::Done)
}
