//! `trade`: what settings cost against what they give.

use super::limits::{number, verdict};
use super::print::print;
use super::source::Source;
use lf_core::Result;
use lf_core::cli::{Session, Verdict};
use lf_validate::runs::trade::{Ask, ChartOptions, trade};

#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    source: Source,
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
    /// What the cost is called in the picture, with its unit [default: its key]
    #[arg(long, value_name = "TEXT", requires = "plot")]
    cost_name: Option<String>,
    /// What the error is called in the picture, with its unit [default: its key]
    #[arg(long, value_name = "TEXT", requires = "plot")]
    error_name: Option<String>,
}

/// Reads, judges, draws, prints.
pub fn judge(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let Arguments { source, max_cost, max_error, .. } = arguments;
    let records = source.records(session)?;
    let ask = Ask {
        name: arguments.name.clone(),
        cost: arguments.cost.clone(),
        error: arguments.error.clone(),
        memory: arguments.memory.clone(),
        base: arguments.base.clone(),
    };
    let trade = session.phase("judge", |_| trade(&records, &ask).map_err(|refusal| source.refused(refusal)))?;
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
    if let Some(line) = trade.missing.line(trade.runs) {
        session.warn(line);
    }
    Ok(verdict(!trade.within(*max_cost, *max_error).is_empty()))
}
