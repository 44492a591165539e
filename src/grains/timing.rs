//! Time of a run: wall clock per phase of the step, and the part of it in which a rank had no core.

use std::time::{Duration, Instant};

/// A phase of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Integration of positions and orientations, wall motion.
    Move,
    /// Migration, ghosts, load balance and the list of pairs, when the list is rebuilt.
    Rebuild,
    /// Exchange of ghosts in every step: packing, sending, waiting.
    Exchange,
    /// Contact resolution.
    Contacts,
    /// Force law and the sum over contacts.
    Forces,
    /// Small global agreements: whether the list is stale, whether the packing has come to rest.
    Agree,
    /// Resolving a sample of contacts again.
    Audit,
    /// Snapshots and the table of scalars.
    Output,
}

impl Phase {
    /// All phases, in the order of a report.
    pub const ALL: [Self; 8] = [
        Self::Move,
        Self::Agree,
        Self::Rebuild,
        Self::Exchange,
        Self::Contacts,
        Self::Forces,
        Self::Audit,
        Self::Output,
    ];

    /// Name in the report.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Move => "move",
            Self::Rebuild => "rebuild",
            Self::Exchange => "exchange",
            Self::Contacts => "contacts",
            Self::Forces => "forces",
            Self::Agree => "agree",
            Self::Audit => "audit",
            Self::Output => "output",
        }
    }
}

/// A stopwatch that assigns the time since its last reading to a phase.
#[derive(Clone, Debug)]
pub struct Clock {
    last: Instant,
    spent: [Duration; Phase::ALL.len()],
    /// Result of [`without_core`] at the start.
    without_core: Option<Duration>,
}

impl Clock {
    /// A clock that starts now.
    pub fn new() -> Self {
        let spent = [Duration::ZERO; Phase::ALL.len()];
        Self { last: Instant::now(), spent, without_core: without_core() }
    }

    /// Starts a reading without assigning the time before it to any phase.
    pub fn restart(&mut self) {
        self.last = Instant::now();
    }

    /// Assigns the time since the last reading to `phase`.
    pub fn lap(&mut self, phase: Phase) {
        let now = Instant::now();
        self.spent[phase as usize] += now - self.last;
        self.last = now;
    }

    /// Time assigned to a phase so far [s].
    pub fn seconds(&self, phase: Phase) -> f64 {
        self.spent[phase as usize].as_secs_f64()
    }

    /// Time since the start in which this thread was ready but other programs had its core [s]; `None` where the system does not report it.
    pub fn seconds_without_core(&self) -> Option<f64> {
        Some(without_core()?.saturating_sub(self.without_core?).as_secs_f64())
    }
}

/// Such time since the start of this thread. Linux counts it, see `schedstats` in its documentation of the scheduler.
fn without_core() -> Option<Duration> {
    let counts = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(Duration::from_nanos(counts.split(' ').nth(1)?.parse().ok()?))
}

impl Default for Clock {
    fn default() -> Self {
        Self::new()
    }
}
