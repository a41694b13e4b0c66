//! `--max-memory`, `estimated_bytes` and the answer to `--estimate`: one sum for all three.
//!
//! A tool states how many bytes its work will take, in addition to those that it holds once its inputs are read.
//! `--estimate` prints the sum of both, `--stats` records it as `estimated_bytes`, and a sum above the limit is refused
//! before the work begins.

use super::kernel_tables::{peak_bytes, status_bytes, table_bytes};
use super::session::Session;
use crate::{Error, Result, io};
use serde_json::json;
use std::path::Path;

/// Resident memory of a tool that has read its inputs, bytes; used if the system does not report it.
const HELD_BYTES: u64 = 1 << 26;
/// Bytes that the allocator takes for each byte asked for.
const WORK_FACTOR: f64 = 1.05;
/// Bytes of code that the work loads, and bytes of a thread: its stack and its small allocations.
const CODE_BYTES: f64 = 3e6;
const THREAD_BYTES: f64 = 5e5;
/// The default limit as a share of the machine's memory. The rest is for the system and for files that it keeps.
const SHARE_OF_MACHINE: f64 = 0.8;
/// The default limit if the system does not report its memory, bytes.
const USUAL_BYTES: f64 = 8e9;
/// Smallest and largest limit, GB.
const LIMITS_GB: [f64; 2] = [1e-3, 1e6];

/// The limit of memory; `#[command(flatten)]` it in the arguments of a tool.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct MemoryLimit {
    /// Refuse a run that needs more memory than this, GB [default: four fifths of the machine's]
    #[arg(long, value_name = "GB", value_parser = gigabytes, global = true)]
    pub max_memory: Option<f64>,
}

fn gigabytes(text: &str) -> std::result::Result<f64, String> {
    let [least, most] = LIMITS_GB;
    let typed = text.trim().parse::<f64>().ok().filter(|typed| (least..=most).contains(typed));
    typed.ok_or_else(|| format!("wanted {least} to {most} GB"))
}

impl MemoryLimit {
    /// The limit in bytes.
    pub fn bytes(&self) -> u64 {
        let typed = self.max_memory.map(|typed| 1e9 * typed);
        typed.unwrap_or_else(|| machine_bytes().map_or(USUAL_BYTES, |bytes| SHARE_OF_MACHINE * bytes as f64)) as u64
    }
}

impl Session {
    /// Refuses work that would bring this process above the limit. The error is about `subject`; `what` takes
    /// `work_bytes` in addition to the memory in use now, such as `a grid of 9 x 9 x 9 voxels`.
    pub fn allow_memory(
        &mut self,
        limit: MemoryLimit,
        work_bytes: f64,
        subject: impl Into<String>,
        what: impl FnOnce() -> String,
    ) -> Result<()> {
        let bytes = peak_with(work_bytes);
        self.count("estimated_bytes", bytes);
        let [needed, most] = [bytes, limit.bytes()].map(gigabytes_of);
        self.explain(format!("about {needed} GB of memory, of {most} GB allowed"));
        check_memory(limit, work_bytes, subject, what)
    }

    /// Prints the answer to `--estimate`: a JSON object with `memory_bytes`, the peak memory of a run, with `counts`,
    /// and with `lengths` in mm along x, y, z. The peak is `work_bytes` plus the memory held now, with the inputs read.
    pub fn print_estimate(
        &mut self,
        work_bytes: u64,
        counts: &[(&str, u64)],
        lengths: &[(&str, [f64; 3])],
    ) -> Result<()> {
        let bytes = peak_with(work_bytes as f64);
        self.count("estimated_bytes", bytes);
        let mut estimate = json!({"memory_bytes": bytes});
        counts.iter().for_each(|(name, count)| estimate[name] = json!(count));
        lengths.iter().for_each(|(name, length)| estimate[name] = json!(length));
        io::save_text(Path::new("-"), |out| writeln!(out, "{estimate}"))
    }
}

/// Refuses like [`Session::allow_memory`], but records nothing: for a part of the work that is known early, or for an
/// upper bound.
pub fn check_memory(
    limit: MemoryLimit,
    work_bytes: f64,
    subject: impl Into<String>,
    what: impl FnOnce() -> String,
) -> Result<()> {
    let [bytes, most] = [peak_with(work_bytes), limit.bytes()];
    if bytes <= most {
        return Ok(());
    }
    let [needed, most] = [bytes, most].map(gigabytes_of);
    let found = format!("{} would take about {needed} GB", what());
    Err(Error::new(subject, found, format!("wanted {most} GB at most, as --max-memory allows")))
}

/// The peak memory of the process if the work takes `work_bytes` more. Freed memory does not count as held: the work
/// uses it again.
fn peak_with(work_bytes: f64) -> u64 {
    io::release_memory();
    let held = status_bytes("VmRSS:").unwrap_or(HELD_BYTES);
    let code = CODE_BYTES + THREAD_BYTES * rayon::current_num_threads() as f64;
    // The cast saturates.
    held.saturating_add((WORK_FACTOR * work_bytes + code) as u64).max(peak_bytes().unwrap_or(0))
}

/// Bytes in GB with three digits.
fn gigabytes_of(bytes: u64) -> f64 {
    format!("{:.2e}", 1e-9 * bytes as f64).parse().unwrap_or(f64::INFINITY)
}

/// Memory of the machine, bytes; the limit of this process's control group if that is less.
fn machine_bytes() -> Option<u64> {
    let read = |file: &str| std::fs::read_to_string(file).ok();
    let own = read("/proc/self/cgroup").unwrap_or_default();
    group_bytes(&own, read).into_iter().chain(table_bytes("/proc/meminfo", "MemTotal:")).min()
}

/// The smallest limit of the control groups that a process is in and of their parents, bytes: the limit of a job is set
/// some levels above its processes. `own` is `/proc/self/cgroup`; `read` gives the text of a file.
fn group_bytes(own: &str, read: impl Fn(&str) -> Option<String>) -> Option<u64> {
    const ROOTS_OF_ALL: &str = "0::/\n0:memory:/";
    let limit = |file: String| read(&file)?.trim().parse::<u64>().ok();
    let limits = own.lines().chain(ROOTS_OF_ALL.lines()).filter_map(|line| {
        let [_, kinds, group] = line.splitn(3, ':').collect::<Vec<_>>().try_into().ok()?;
        let (roots, name): (&[&str], _) = match kinds {
            "" => (&["/sys/fs/cgroup", "/sys/fs/cgroup/unified"], "memory.max"),
            _ if kinds.split(',').any(|kind| kind == "memory") => (&["/sys/fs/cgroup/memory"], "memory.limit_in_bytes"),
            _ => return None,
        };
        let around = Path::new(group).ancestors().map(|group| group.display().to_string());
        let files = around.flat_map(|group| {
            let group = group.trim_end_matches('/').to_owned();
            roots.iter().map(move |root| format!("{root}{group}/{name}"))
        });
        files.filter_map(limit).min()
    });
    limits.min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_process_and_machine_is_known_here() {
        let (peak, machine) = (peak_bytes().unwrap(), machine_bytes().unwrap());
        assert!(100_000 < peak && peak < machine, "{peak} {machine}");
        let usual = MemoryLimit { max_memory: None }.bytes();
        assert!((usual as f64 / machine as f64 - SHARE_OF_MACHINE).abs() < 1e-6);
        assert_eq!(MemoryLimit { max_memory: Some(0.5) }.bytes(), 500_000_000);
    }

    #[test]
    fn the_limit_of_a_job_stands_above_its_processes() {
        let limit = |own: &str, known: &[(&str, &str)]| {
            group_bytes(own, |file| known.iter().find(|(name, _)| *name == file).map(|(_, text)| format!("{text}\n")))
        };
        let job = "/system.slice/slurmstepd.scope/job_7";
        let own = format!("0::{job}/step_0/user/task_0");
        let second = [
            (format!("/sys/fs/cgroup{job}/step_0/memory.max"), "max"),
            (format!("/sys/fs/cgroup{job}/memory.max"), "4000000000"),
            ("/sys/fs/cgroup/memory.max".to_owned(), "9000000000"),
        ];
        let second = second.each_ref().map(|(file, text)| (file.as_str(), *text));
        assert_eq!(limit(&own, &second), Some(4_000_000_000));
        let first = [("/sys/fs/cgroup/memory/slurm/uid_1/job_7/memory.limit_in_bytes", "3000000000")];
        let own = "5:cpu,cpuacct:/slurm\n4:hugetlb,memory:/slurm/uid_1/job_7/step_0\n0::/\n";
        assert_eq!(limit(own, &first), Some(3_000_000_000));
        assert_eq!(limit("", &[("/sys/fs/cgroup/memory/memory.limit_in_bytes", "2000000000")]), Some(2_000_000_000));
        assert_eq!(limit("4:memory\n\n", &[]), None);
    }

    #[test]
    fn limits_are_numbers_within_reach() {
        assert_eq!(gigabytes(" 2.5"), Ok(2.5));
        for wrong in ["0", "-1", "NaN", "inf", "1e7", "lots", ""] {
            assert_eq!(gigabytes(wrong), Err("wanted 0.001 to 1000000 GB".to_owned()), "{wrong}");
        }
    }
}
