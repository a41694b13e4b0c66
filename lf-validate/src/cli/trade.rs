//! `trade`: cost against error of settings.

use super::limits::{number, verdict};
use super::{output::print, source::RunSource};
use lf_core::{Result, Session, Verdict};
use lf_validate::runs::trade::{ChartOptions, TradeKeys, trade};

/// Cost against error of settings: the Pareto front, and the effect of each factor
///
/// Runs of one name, which differ only in set.seed, form a setting.
///
///   cost, error, memory  medians over the runs of a setting; *_range: least and greatest
///   front                settings that no other dominates, by rising cost. A setting dominates
///                        another if neither its cost nor its error is greater, and one is less
///   dominated_by         the setting on the front with at most this cost and the least error
///   factors              with --base: settings that differ from the base in exactly one key set.KEY,
///                        by that key, with cost, error and memory over those of the base (*_ratio)
///   ungrouped            with --base: settings that differ in more keys, or in none
///
/// Runs without name, cost or error are left out, and a warning counts them.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo, with the runs.jsonl that `lf-validate line --help` makes:
  lf-validate trade runs.jsonl --error missed_share
  lf-validate trade runs.jsonl --error missed_share --cost peak_bytes --plot trade.svg"
)]
pub struct Arguments {
    #[command(flatten)]
    source: RunSource,
    /// Key of the cost
    #[arg(long, value_name = "KEY", default_value = "seconds")]
    cost: String,
    /// Key of the error
    #[arg(long, value_name = "KEY", default_value = "rms_w_px")]
    error: String,
    /// Key of the memory
    #[arg(long, value_name = "KEY", default_value = "peak_bytes")]
    memory: String,
    /// Key of a setting's name
    #[arg(long, value_name = "KEY", default_value = "name")]
    name: String,
    /// Compare with the setting of this name, factor by factor
    #[arg(long, value_name = "NAME")]
    base: Option<String>,
    /// Exit code 1 when no setting has at most this cost (and keeps --max-error)
    #[arg(long, value_name = "C", value_parser = number)]
    max_cost: Option<f64>,
    /// Exit code 1 when no setting has at most this error (and keeps --max-cost)
    #[arg(long, value_name = "E", value_parser = number)]
    max_error: Option<f64>,
    /// Name of the cost in the picture, with its unit [default: its key]
    #[arg(long, value_name = "TEXT", requires = "plot")]
    cost_name: Option<String>,
    /// Name of the error in the picture, with its unit [default: its key]
    #[arg(long, value_name = "TEXT", requires = "plot")]
    error_name: Option<String>,
}

/// Compares the settings of runs.
pub fn judge(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let Arguments { source, max_cost, max_error, .. } = arguments;
    let records = source.records(session)?;
    let keys = TradeKeys {
        name: arguments.name.clone(),
        cost: arguments.cost.clone(),
        error: arguments.error.clone(),
        memory: arguments.memory.clone(),
        base: arguments.base.clone(),
    };
    let trade = session.phase("judge", |_| trade(&records, &keys).map_err(|refusal| source.refused(refusal)))?;
    session.count("runs", records.len());
    session.count("settings", trade.settings.len());
    session.count("front", trade.front.len());
    source.draw(session, |title| {
        trade.chart(&ChartOptions {
            title,
            cost_name: arguments.cost_name.clone().unwrap_or_default(),
            error_name: arguments.error_name.clone().unwrap_or_default(),
            max_cost: *max_cost,
            max_error: *max_error,
        })
    })?;
    print(&trade)?;
    if let Some(warning) = trade.missing.warning(trade.runs) {
        session.warn(warning);
    }
    Ok(verdict(!trade.within(*max_cost, *max_error).is_empty()))
}
