//! Whether there is memory for what comes next: asked before a large list grows, because a program that is refused memory in the
//! middle of that is ended by the system without a word.
//!
//! Three sources say how much there is: the figure that the system calls available (with the limit of its control group), a limit of
//! our own, and whether the allocator would give a block of that size at all (`ulimit -v`, address space).

use std::fs::read_to_string;

/// Less than this is given without a question: asking costs some microseconds.
const SMALL: u64 = 16 << 20;
/// The part of the available memory that may be taken; the rest is for other processes.
const SHARE: f64 = 0.9;

/// Ticks after which the memory that surroundings take is looked at.
pub const TICKS_OF_MEMORY: u64 = 8;

/// Memory that is not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shortage {
    /// Bytes that were wanted.
    pub wanted: u64,
    /// Bytes that there are; `None` if the allocator has said no and not how many it would give.
    pub there: Option<u64>,
    /// It is a limit of our own that says so.
    pub own_limit: bool,
}

impl Shortage {
    /// What was wanted, and what there is, for a message.
    pub fn note(&self) -> String {
        let wanted = format!("{:.0} MB more were wanted", self.wanted as f64 / 1e6);
        match self.there {
            Some(there) => format!("{wanted}, and there are {:.0} MB", there as f64 / 1e6),
            None => format!("{wanted}, and the system does not give them"),
        }
    }

    /// What allows more, if it is a limit of our own.
    pub fn help(&self) -> Option<String> {
        self.own_limit.then(|| "allow more with `--max-memory`, such as `--max-memory 8GB`".to_owned())
    }
}

/// Asks for a little more, where nobody counts what is taken, as in surroundings: what is taken by then, counts. It costs some 20 µs.
///
/// # Errors
/// If it is not there.
pub fn ask_for_a_little(limit: u64) -> Result<(), Shortage> {
    ask(SMALL.min(limit / 64).max(1), limit, 0)
}

/// Asks for so many bytes more; `limit` is what the process may take in all, `used` what it takes at least, where the system
/// does not say how much that is.
///
/// # Errors
/// If they are not there.
pub fn ask(wanted: u64, limit: u64, used: u64) -> Result<(), Shortage> {
    // A limit may be smaller than anything that is called small.
    if wanted < SMALL.min(limit / 64) {
        return Ok(());
    }
    if limit < u64::MAX {
        let there = limit.saturating_sub(resident().unwrap_or(used).max(used));
        if wanted > there {
            return Err(Shortage { wanted, there: Some(there), own_limit: true });
        }
    }
    let available = [available(), in_group("/sys/fs/cgroup")].into_iter().flatten().min();
    if let Some(there) = available.map(|bytes| (bytes as f64 * SHARE) as u64)
        && wanted > there
    {
        return Err(Shortage { wanted, there: Some(there), own_limit: false });
    }
    // Never touched, so it costs no memory, only the answer.
    let mut block: Vec<u8> = Vec::new();
    match usize::try_from(wanted).ok().filter(|bytes| block.try_reserve_exact(*bytes).is_ok()) {
        Some(_) => Ok(()),
        None => Err(Shortage { wanted, there: None, own_limit: false }),
    }
}

/// Bytes that the system can give, where it says so (Linux).
fn available() -> Option<u64> {
    kilobytes(&read_to_string("/proc/meminfo").ok()?, "MemAvailable:")
}

/// Bytes of memory that this process takes, where the system says so (Linux).
pub fn resident() -> Option<u64> {
    kilobytes(&read_to_string("/proc/self/status").ok()?, "VmRSS:")
}

/// Bytes that the control group has left.
fn in_group(folder: &str) -> Option<u64> {
    let number = |file: &str| read_to_string(format!("{folder}/{file}")).ok()?.trim().parse::<u64>().ok();
    let most = number("memory.max").or_else(|| number("memory/memory.limit_in_bytes"))?;
    let used = number("memory.current").or_else(|| number("memory/memory.usage_in_bytes"))?;
    Some(most.saturating_sub(used))
}

/// A line such as `MemAvailable:   24000 kB`.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_there_is_refused_and_what_is_small_is_not_asked_for() {
        assert_eq!(ask(1 << 20, u64::MAX, 0), Ok(()));
        assert!(ask(1 << 60, u64::MAX, 0).is_err());
        assert!(ask(u64::MAX, u64::MAX, 0).is_err());
    }

    #[test]
    fn a_limit_of_our_own_counts_what_is_used() {
        assert_eq!(ask(100 << 20, 1 << 50, 0), Ok(()));
        let refused = ask(100 << 20, 500 << 20, 450 << 20).expect_err("450 and 100 are more than 500");
        assert!(refused.own_limit && refused.there.is_some_and(|there| there <= 50 << 20), "{refused:?}");
        assert!(ask(1, 0, 0).is_err());
    }

    #[test]
    fn what_the_system_says_is_read() {
        let text = "MemTotal:       24 kB\nMemAvailable:   23000000 kB\n";
        assert_eq!(kilobytes(text, "MemAvailable:"), Some(23_552_000_000));
        assert_eq!(kilobytes("MemAvailable: many", "MemAvailable:"), None);
        let folder = tempfile::tempdir().expect("a directory");
        std::fs::write(folder.path().join("memory.max"), "max\n").expect("written");
        std::fs::write(folder.path().join("memory.current"), "70\n").expect("written");
        let path = folder.path().to_str().expect("plain");
        assert_eq!(in_group(path), None, "no limit");
        std::fs::write(folder.path().join("memory.max"), "100\n").expect("written");
        assert_eq!(in_group(path), Some(30));
    }
}
