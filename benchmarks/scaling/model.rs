//! Model of the time of a step from counts, and of the counts from the particles per rank.

use crate::counted::{BYTES, CONTACTS, Counts, GHOSTS, MESSAGES, PARTICLES, REDUCTIONS, Run};

/// Cost of parts of a step: those of a core measured on one rank, those of the network assumed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Costs {
    /// Time per particle, owned or ghost: motion and pair list [s].
    pub(crate) particle: f64,
    /// Time per contact: resolution, including pairs without contact, and force [s].
    pub(crate) contact: f64,
    /// Time per message [s].
    pub(crate) latency: f64,
    /// Bandwidth [B/s].
    pub(crate) bandwidth: f64,
}

impl Costs {
    /// Time of a rank's own work [s].
    fn work(&self, counts: &Counts) -> f64 {
        (counts[PARTICLES] + counts[GHOSTS]) * self.particle + counts[CONTACTS] * self.contact
    }

    /// Time of a step of a rank, without overlap of communication and work [s].
    pub(crate) fn step(&self, counts: &Counts, ranks: f64) -> f64 {
        self.work(counts)
            + counts[MESSAGES] * self.latency
            + counts[BYTES] / self.bandwidth
            + counts[REDUCTIONS] * self.latency * ranks.log2()
    }

    /// Time of one rank with an equal share of `alone` over the time of the slowest rank.
    pub(crate) fn efficiency(&self, run: &Run, alone: &Run) -> f64 {
        let ranks = run.ranks.len() as f64;
        let share =
            self.work(&alone.ranks[0]) * run.total(PARTICLES) / alone.total(PARTICLES) / ranks;
        share / run.ranks.iter().map(|counts| self.step(counts, ranks)).fold(0.0, f64::max)
    }
}

/// `a n^(2/3) + b`: quantities that grow with the surface of a rank's share of n particles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) a: f64,
    pub(crate) b: f64,
}

impl Surface {
    /// Least-squares fit of the relative residuals over points (n, value).
    pub(crate) fn fit(points: &[(f64, f64)]) -> Self {
        let mut sums = [0.0; 5];
        for &(n, value) in points {
            // a u + b v = 1
            let (u, v) = (n.powf(2.0 / 3.0) / value, 1.0 / value);
            for (sum, term) in sums.iter_mut().zip([u * u, u * v, v * v, u, v]) {
                *sum += term;
            }
        }
        let [uu, uv, vv, u, v] = sums;
        let det = uu * vv - uv * uv;
        Self { a: (u * vv - v * uv) / det, b: (uu * v - uv * u) / det }
    }

    pub(crate) fn at(&self, n: f64) -> f64 {
        self.a * n.powf(2.0 / 3.0) + self.b
    }
}

/// Counts of a rank with n particles that is surrounded by others.
pub(crate) struct Laws {
    pub(crate) ghosts: Surface,
    pub(crate) bytes: Surface,
    /// Contacts in addition to those of a rank alone: contacts with ghosts are resolved by both
    /// owners.
    pub(crate) shared: Surface,
    /// Contacts per particle of a rank alone.
    pub(crate) contacts: f64,
    /// Largest count of any rank.
    pub(crate) messages: f64,
    pub(crate) reductions: f64,
}

impl Laws {
    /// Laws from runs in which every rank has neighbours on all sides, and from one rank alone.
    pub(crate) fn fit(runs: &[&Run], alone: &Run) -> Self {
        let contacts = alone.mean(CONTACTS) / alone.mean(PARTICLES);
        let law = |of: &dyn Fn(&Run) -> f64| {
            Surface::fit(&runs.iter().map(|run| (run.mean(PARTICLES), of(run))).collect::<Vec<_>>())
        };
        let most = |which| runs.iter().map(|run| run.most(which)).fold(0.0, f64::max);
        Self {
            ghosts: law(&|run| run.mean(GHOSTS)),
            bytes: law(&|run| run.mean(BYTES)),
            shared: law(&|run| shared(run, contacts)),
            contacts,
            messages: most(MESSAGES),
            reductions: most(REDUCTIONS),
        }
    }

    /// Counts of a rank with n particles.
    pub(crate) fn counts(&self, n: f64) -> Counts {
        let mut counts = Counts::default();
        counts[PARTICLES] = n;
        counts[GHOSTS] = self.ghosts.at(n);
        counts[CONTACTS] = n * self.contacts + self.shared.at(n);
        counts[MESSAGES] = self.messages;
        counts[BYTES] = self.bytes.at(n);
        counts[REDUCTIONS] = self.reductions;
        counts
    }

    /// Efficiency with n particles per rank and equal work on all ranks.
    pub(crate) fn efficiency(&self, costs: &Costs, n: f64, ranks: f64) -> f64 {
        let mut alone = Counts::default();
        alone[PARTICLES] = n;
        alone[CONTACTS] = n * self.contacts;
        costs.work(&alone) / costs.step(&self.counts(n), ranks)
    }
}

/// Contacts per rank in addition to `contacts` per particle.
pub(crate) fn shared(run: &Run, contacts: f64) -> f64 {
    run.mean(CONTACTS) - contacts * run.mean(PARTICLES)
}
