//! How much memory the process has used at most, and how much there is.

/// The process's peak resident memory in MB (10⁶ bytes) where the system tells it (Linux: `VmHWM`).
pub fn peak_memory_mb() -> Option<f64> {
    high_water_mb(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// From now on, [`peak_memory_mb`] tells of what comes; where the system does not allow it (Linux does), of all so far as ever.
pub fn forget_peak_memory() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// The machine's memory in bytes, where the system tells it (Linux: `MemTotal`).
pub(crate) fn memory_bytes() -> Option<f64> {
    total_bytes(&std::fs::read_to_string("/proc/meminfo").ok()?)
}

fn total_bytes(meminfo: &str) -> Option<f64> {
    kibibytes(meminfo, "MemTotal:").map(|kibibytes| kibibytes * 1024.0)
}

fn high_water_mb(status: &str) -> Option<f64> {
    kibibytes(status, "VmHWM:").map(|kibibytes| kibibytes * 1024.0 / 1e6)
}

fn kibibytes(table: &str, key: &str) -> Option<f64> {
    let line = table.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_the_high_water_mark() {
        assert_eq!(
            high_water_mb("VmPeak:\t 9 kB\nVmHWM:\t   125000 kB\nVmRSS: 1 kB"),
            Some(128.0)
        );
        assert_eq!(high_water_mb("VmRSS: 1 kB"), None);
        assert_eq!(
            total_bytes("MemTotal:       1000 kB\nMemFree: 1 kB"),
            Some(1_024_000.0)
        );
    }
}
