//! Memory by the tables of the kernel in `/proc`.

/// Peak resident memory of this process, bytes; None if the system does not report it.
pub(super) fn peak_bytes() -> Option<u64> {
    status_bytes("VmHWM:")
}

/// A value of `/proc/self/status`, bytes.
pub(super) fn status_bytes(key: &str) -> Option<u64> {
    table_bytes("/proc/self/status", key)
}

/// A value of a file of `/proc` that lists kB, in bytes.
pub(super) fn table_bytes(file: &str, key: &str) -> Option<u64> {
    let table = std::fs::read_to_string(file).ok()?;
    let line = table.lines().find_map(|line| line.strip_prefix(key))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}
