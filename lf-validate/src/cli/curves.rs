//! `curves`: runs as curves.

use super::{limits::number, output::print, source::RunSource};
use lf_core::{Error, Result, Session, Verdict};
use lf_plot::{Axis, Mark, Place};
use lf_validate::runs::curves::{ChartOptions, CurveKeys, curves};

/// Runs as curves: medians over seeds, with their range
///
/// Runs with equal values of --panel, --by and x form a group: they differ in their seed.
///
///   median, low, high  median, least and greatest value of the group
///   runs               runs of the group with a number there
///
/// If x and y are lists, such as a profile, each run is a curve, and groups are formed bin by bin.
/// All runs of a series need the same bins. If x has one number more than y, it holds the edges of
/// bins, and their centres are given. Numeric series are sorted by number. Runs that lack a key are
/// left out, and a warning counts them. In the picture the line is the median, and the area reaches
/// from least to greatest.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo; the second is of what lf-mart --log writes:
  lf-validate curves displacement.json -x pdf.x_u -y pdf.u,pdf.v --log-y --plot density.svg
  lf-validate curves sweeps.jsonl -x iteration -y misfit --log-x --plot sweeps.svg"
)]
pub struct Arguments {
    #[command(flatten)]
    source: RunSource,
    /// Key of x: a number or a list
    #[arg(short, value_name = "KEY")]
    x: String,
    /// Keys of y, numbers or lists. Each gives its own series
    #[arg(short, value_name = "KEY,...", value_delimiter = ',', required = true)]
    y: Vec<String>,
    /// One series for each value of KEY, or for each combination of values
    #[arg(long, value_name = "KEY,...", value_delimiter = ',')]
    by: Vec<String>,
    /// One panel for each value of KEY
    #[arg(long, value_name = "KEY")]
    panel: Option<String>,
    /// Name of the x axis, with its unit [default: its key]
    #[arg(long, value_name = "TEXT", requires = "plot")]
    x_name: Option<String>,
    /// Name of the y axis, with its unit [default: its keys]
    #[arg(long, value_name = "TEXT", requires = "plot")]
    y_name: Option<String>,
    /// Logarithmic x axis
    #[arg(long, requires = "plot")]
    log_x: bool,
    /// Logarithmic y axis
    #[arg(long, requires = "plot")]
    log_y: bool,
    /// Ends of the x axis
    #[arg(long, value_name = "LOW,HIGH", requires = "plot", value_parser = range, allow_hyphen_values = true)]
    x_range: Option<[f64; 2]>,
    /// Ends of the y axis
    #[arg(long, value_name = "LOW,HIGH", requires = "plot", value_parser = range, allow_hyphen_values = true)]
    y_range: Option<[f64; 2]>,
    /// Horizontal line to compare with, named in the legend. May be given again
    #[arg(long, value_name = "NAME=VALUE", requires = "plot", value_parser = named)]
    reference: Vec<(String, f64)>,
    /// Vertical line to compare with, named in the legend. May be given again
    #[arg(long, value_name = "NAME=VALUE", requires = "plot", value_parser = named)]
    reference_x: Vec<(String, f64)>,
}

/// Groups runs into curves.
pub fn plot(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let source = &arguments.source;
    once("-y", &arguments.y)?;
    once("--by", &arguments.by)?;
    let records = source.records(session)?;
    let keys = CurveKeys {
        x: arguments.x.clone(),
        y: arguments.y.clone(),
        by: arguments.by.clone(),
        panel: arguments.panel.clone(),
    };
    let curves = session.phase("group", |_| curves(&records, &keys).map_err(|refusal| source.refused(refusal)))?;
    session.count("runs", records.len());
    session.count("series", curves.series.len());
    source.draw(session, |title| curves.chart(&chart_options(arguments, title)))?;
    print(&curves)?;
    if let Some(warning) = curves.missing.warning(curves.runs) {
        session.warn(warning);
    }
    Ok(Verdict::Done)
}

/// Axes and references of the chart.
fn chart_options(arguments: &Arguments, title: String) -> ChartOptions {
    let axis = |name: &Option<String>, is_log, range| Axis { name: name.clone().unwrap_or_default(), is_log, range };
    let horizontal = arguments.reference.iter().map(|(name, y)| Mark::reference(name, Place::Horizontal(*y)));
    let vertical = arguments.reference_x.iter().map(|(name, x)| Mark::reference(name, Place::Vertical(*x)));
    ChartOptions {
        title,
        x: axis(&arguments.x_name, arguments.log_x, arguments.x_range),
        y: axis(&arguments.y_name, arguments.log_y, arguments.y_range),
        references: horizontal.chain(vertical).collect(),
    }
}

/// Refuses a key named twice.
fn once(option: &str, keys: &[String]) -> Result<()> {
    match keys.iter().enumerate().find(|(n, key)| keys[..*n].contains(key)) {
        Some((_, key)) => Err(Error::new(option, format!("{key} is named twice"), "wanted each key once")),
        None => Ok(()),
    }
}

/// Parses `LOW,HIGH`.
fn range(text: &str) -> std::result::Result<[f64; 2], String> {
    let (low, high) = text.split_once(',').ok_or("wanted LOW,HIGH")?;
    Ok([number(low.trim())?, number(high.trim())?])
}

/// Parses `NAME=VALUE`.
fn named(text: &str) -> std::result::Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').ok_or("wanted NAME=VALUE")?;
    Ok((name.to_owned(), number(value)?))
}
