//! The file of `--stats`.

use super::{memory::peak_bytes, session::Session};
use crate::{Result, io};
use serde_json::{Map, json};

impl Session {
    /// Writes the file; does nothing without `--stats`.
    pub(super) fn save_stats(&self) -> Result<()> {
        let Some(path) = &self.common.stats else { return Ok(()) };
        let phases: Map<_, _> = self.phases.iter().map(|(name, seconds)| (name.clone(), json!(seconds))).collect();
        let stats = json!({
            "tool": self.step.tool,
            "version": self.step.version,
            "threads": rayon::current_num_threads(),
            "seconds": self.started.elapsed().as_secs_f64(),
            "phases": phases,
            "peak_bytes": peak_bytes(),
            "counts": self.counts,
        });
        io::save_text(path, |out| writeln!(out, "{stats:#}"))
    }
}
