//! The file of `--stats`, the answer to `--estimate`, and the memory of this process.

use super::session::Session;
use crate::{Result, io};
use serde_json::{Map, json};
use std::path::Path;

/// Resident memory of a tool that has read its inputs, bytes; used if the system does not tell.
const HELD_BYTES: u64 = 1 << 26;

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

    /// Answers `--estimate` with one JSON object on standard output: `memory_bytes`, the peak memory of a run, and
    /// `counts`. The peak is `work_bytes` plus what the process holds now, with the inputs read.
    pub fn tell_estimate(&mut self, work_bytes: u64, counts: &[(&str, u64)]) -> Result<()> {
        self.tell_estimate_with(work_bytes, counts, &[])
    }

    /// Answers `--estimate` as [`Session::tell_estimate`] does, with `lengths` in mm along x, y, z beside the counts.
    pub fn tell_estimate_with(
        &mut self,
        work_bytes: u64,
        counts: &[(&str, u64)],
        lengths: &[(&str, [f64; 3])],
    ) -> Result<()> {
        let held = status_bytes("VmRSS:").unwrap_or(HELD_BYTES) + work_bytes;
        let memory_bytes = held.max(peak_bytes().unwrap_or(0));
        self.count("estimated_bytes", memory_bytes);
        let mut told = json!({"memory_bytes": memory_bytes});
        for (name, count) in counts {
            told[name] = json!(count);
        }
        for (name, length) in lengths {
            told[name] = json!(length);
        }
        io::save_text(Path::new("-"), |out| writeln!(out, "{told}"))
    }
}

/// Peak resident memory of this process, bytes; None if the system does not tell.
fn peak_bytes() -> Option<u64> {
    status_bytes("VmHWM:")
}

/// A value in kB from the system's status of this process, in bytes.
fn status_bytes(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peak_memory_is_known_here() {
        assert!(peak_bytes().is_some_and(|bytes| bytes > 100_000));
    }
}
