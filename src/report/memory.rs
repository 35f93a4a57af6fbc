//! How much memory the process has used at most.

/// The process's peak resident memory in MB (10⁶ bytes) where the system tells it (Linux: `VmHWM`).
pub fn peak_memory_mb() -> Option<f64> {
    high_water_mb(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// From now on, [`peak_memory_mb`] tells of what comes; where the system does not allow it (Linux does), of all so far as ever.
pub fn forget_peak_memory() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn high_water_mb(status: &str) -> Option<f64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024.0 / 1e6)
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
    }
}
