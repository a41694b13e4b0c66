//! Processor time of a thread.

/// Seconds of processor time that this thread has taken; other work on the machine does not count. The time of day on
/// systems that do not report it.
pub fn thread_seconds() -> f64 {
    #[cfg(unix)]
    {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
    }
    #[cfg(not(unix))]
    {
        std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0.0, |past| past.as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use super::thread_seconds;
    use std::hint::black_box;

    /// Work takes processor time.
    #[test]
    fn time_passes_while_a_thread_works() {
        let before = thread_seconds();
        let mut sum = 0u64;
        (0..20_000_000u64).for_each(|n| sum = black_box(sum.wrapping_mul(31) ^ n));
        let taken = thread_seconds() - before;
        assert!(taken > 1e-4 && taken < 600.0, "{taken} s, {sum}");
    }
}
