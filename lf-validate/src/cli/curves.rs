//! `curves`: runs to curves.

use super::limits::number;
use super::print::print;
use super::source::Source;
use lf_core::cli::{Session, Verdict};
use lf_core::plot::{Axis, Mark, Place};
use lf_core::{Error, Result};
use lf_validate::runs::curves::{Ask, ChartOptions, curves};

#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    source: Source,
    /// Key along the axis: a number, or a list
    #[arg(short, value_name = "KEY")]
    x: String,
    /// Keys of the values, numbers or lists; each gives its own series
    #[arg(short, value_name = "KEY,...", value_delimiter = ',', required = true)]
    y: Vec<String>,
    /// One series for each value of KEY, or of several
    #[arg(long, value_name = "KEY,...", value_delimiter = ',')]
    by: Vec<String>,
    /// One panel for each value of KEY
    #[arg(long, value_name = "KEY")]
    panel: Option<String>,
    /// What the axis is called, with its unit [default: its key]
    #[arg(long, value_name = "TEXT", requires = "plot")]
    x_name: Option<String>,
    /// What the upright axis is called, with its unit [default: its keys]
    #[arg(long, value_name = "TEXT", requires = "plot")]
    y_name: Option<String>,
    /// Logarithmic axis
    #[arg(long, requires = "plot")]
    log_x: bool,
    /// Logarithmic upright axis
    #[arg(long, requires = "plot")]
    log_y: bool,
    /// Ends of the axis
    #[arg(long, value_name = "LOW,HIGH", requires = "plot", value_parser = range, allow_hyphen_values = true)]
    x_range: Option<[f64; 2]>,
    /// Ends of the upright axis
    #[arg(long, value_name = "LOW,HIGH", requires = "plot", value_parser = range, allow_hyphen_values = true)]
    y_range: Option<[f64; 2]>,
    /// A level line to compare with, named in the key; may be given again
    #[arg(long, value_name = "NAME=VALUE", requires = "plot", value_parser = named)]
    reference: Vec<(String, f64)>,
    /// An upright one
    #[arg(long, value_name = "NAME=VALUE", requires = "plot", value_parser = named)]
    reference_x: Vec<(String, f64)>,
}

/// Reads, groups, draws, prints.
pub fn plot(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let source = &arguments.source;
    once("-y", &arguments.y)?;
    once("--by", &arguments.by)?;
    let records = source.records(session)?;
    let ask = Ask {
        x: arguments.x.clone(),
        y: arguments.y.clone(),
        by: arguments.by.clone(),
        panel: arguments.panel.clone(),
    };
    let curves = session.phase("group", |_| curves(&records, &ask).map_err(|refusal| source.refused(refusal)))?;
    session.count("runs", records.len());
    session.count("series", curves.series.len());
    source.draw(session, |title| curves.chart(&look(arguments, title)))?;
    print(&curves)?;
    if let Some(line) = curves.missing.line(curves.runs) {
        session.warn(line);
    }
    Ok(Verdict::Done)
}

fn look(arguments: &Arguments, title: String) -> ChartOptions {
    let axis = |name: &Option<String>, is_log, range| Axis { name: name.clone().unwrap_or_default(), is_log, range };
    let level = arguments.reference.iter().map(|(name, y)| Mark::reference(name, Place::Horizontal(*y)));
    let upright = arguments.reference_x.iter().map(|(name, x)| Mark::reference(name, Place::Vertical(*x)));
    ChartOptions {
        title,
        x: axis(&arguments.x_name, arguments.log_x, arguments.x_range),
        y: axis(&arguments.y_name, arguments.log_y, arguments.y_range),
        references: level.chain(upright).collect(),
    }
}

/// Refuses a key named twice.
fn once(option: &str, keys: &[String]) -> Result<()> {
    match keys.iter().enumerate().find(|(n, key)| keys[..*n].contains(key)) {
        Some((_, key)) => Err(Error::new(option, format!("{key} is named twice"), "wanted each key once")),
        None => Ok(()),
    }
}

fn range(text: &str) -> std::result::Result<[f64; 2], String> {
    let (low, high) = text.split_once(',').ok_or("wanted LOW,HIGH")?;
    Ok([number(low.trim())?, number(high.trim())?])
}

fn named(text: &str) -> std::result::Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').ok_or("wanted NAME=VALUE")?;
    Ok((name.to_owned(), number(value)?))
}
