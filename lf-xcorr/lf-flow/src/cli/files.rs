//! Fields in and fields out: one file, or a folder for many.

use clap::ValueEnum;
use lf_core::{Error, Field, Result, Session, io};
use std::fs;
use std::path::{Path, PathBuf};

/// Form of the files in a folder.
#[derive(Clone, Copy, ValueEnum)]
pub enum Form {
    Exr,
    Vti,
    Nc,
    Csv,
}

/// Fields, and where their results go.
#[derive(clap::Args)]
pub struct Files {
    /// Fields (.exr); `-` is standard input
    #[arg(default_value = "-")]
    fields: Vec<PathBuf>,
    /// Where the result goes: .exr, .vti, .nc or .csv; `-` is EXR on standard output. For several fields a
    /// folder, which gets a file of each field's name
    #[arg(short, long, value_name = "FILE|FOLDER", default_value = "-")]
    output: PathBuf,
    /// Form of the files in a folder [default: exr]; a single file has the form of its name
    #[arg(long, value_enum)]
    form: Option<Form>,
}

impl Files {
    /// Each field with the file of its result. Makes the folder; refuses results that overwrite inputs or each other.
    pub fn jobs(&self, session: &Session) -> Result<Vec<(PathBuf, PathBuf)>> {
        let inputs: Vec<&Path> = self.fields.iter().map(PathBuf::as_path).collect();
        let is_folder = self.output.is_dir() && !io::is_standard(&self.output);
        if let ([field], false) = (self.fields.as_slice(), is_folder) {
            if self.form.is_some() {
                let found = format!("given for one file, {}", io::output_name(&self.output));
                return Err(Error::new(
                    "--form",
                    found,
                    "wanted a folder, or the form by the ending of the file's name",
                ));
            }
            session.keep_apart(&self.output, &inputs)?;
            Field::check_place(&self.output)?;
            return Ok(vec![(field.clone(), self.output.clone())]);
        }
        let folder = io::output_name(&self.output);
        if io::is_standard(&self.output) {
            let found = format!("{} fields for standard output", self.fields.len());
            return Err(Error::new("--output", found, "wanted a folder for the results"));
        }
        if self.output.exists() && !is_folder {
            return Err(Error::new(folder, "is a file, for several fields", "wanted a folder for the results"));
        }
        let jobs: Vec<(PathBuf, PathBuf)> =
            self.fields.iter().map(|field| Ok((field.clone(), self.place(field)?))).collect::<Result<_>>()?;
        for (n, (field, output)) in jobs.iter().enumerate() {
            session.keep_apart(output, &inputs)?;
            if jobs[..n].iter().any(|(_, other)| other == output) {
                let found = format!("a second field named {}", output.file_stem().unwrap_or_default().display());
                return Err(Error::new(io::name(field), found, "wanted another name for each"));
            }
        }
        fs::create_dir_all(&self.output).map_err(|error| io::writing(&folder, &error))?;
        jobs.iter().try_for_each(|(_, output)| io::check_place(output))?;
        Ok(jobs)
    }

    /// The file in the folder for the result of a field.
    fn place(&self, field: &Path) -> Result<PathBuf> {
        let stem = field.file_stem().filter(|_| !io::is_standard(field));
        let stem = stem.ok_or_else(|| Error::new(io::name(field), "has no name for its result", "wanted a file"))?;
        let form = self.form.unwrap_or(Form::Exr);
        let ending = form.to_possible_value().map_or_else(String::new, |form| form.get_name().to_owned());
        let mut name = stem.to_owned();
        name.push(format!(".{ending}"));
        Ok(self.output.join(name))
    }
}
