//! `line`: settings and scores to one record.

use lf_core::cli::{Session, Verdict};
use lf_core::{Error, Result, io};
use lf_validate::runs::Refusal;
use lf_validate::runs::{Part, Word, line};
use serde_json::Value;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// Settings and files
    #[arg(required = true, value_name = "KEY=VALUE|[NAME:]FILE")]
    words: Vec<String>,
    /// Where the line goes
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

/// Reads, joins, prints.
pub fn join(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let refused = |subject: String| move |(found, wanted): Refusal| Error::new(subject, found, wanted);
    let words = arguments.words.iter().map(|word| Word::parse(word).map_err(refused("arguments".into())));
    let words = words.collect::<Result<Vec<Word>>>()?;
    let files =
        words.iter().filter_map(|word| if let Word::File(_, file) = word { Some(Path::new(file)) } else { None });
    let files: Vec<&Path> = files.collect();
    session.keep_apart(&arguments.output, &files)?;
    io::check_place(&arguments.output)?;
    let read = |word: Word| match word {
        Word::Setting(key, value) => Ok(Part::setting(key, value)),
        Word::File(name, file) => {
            let (path, source) = (Path::new(file), io::name(Path::new(file)));
            Part::scores(&source, name, &io::open_text(path)?).map_err(refused(source.clone()))
        }
    };
    let parts = session.phase("read", |_| words.into_iter().map(read).collect::<Result<Vec<Part>>>())?;
    let line = Value::Object(line(parts).map_err(refused("arguments".into()))?);
    io::save_text(&arguments.output, |out| writeln!(out, "{line}"))?;
    Ok(Verdict::Done)
}
