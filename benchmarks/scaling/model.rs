//! The time of a step from what is counted, and what is counted from the particles per rank.

use crate::counted::{BYTES, CONTACTS, Counts, GHOSTS, MESSAGES, PARTICLES, REDUCTIONS, Run};

/// What a step costs: the core's figures measured on one rank, the network's stated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Costs {
    /// Of a particle, owned or ghost: motion, the list of pairs [s].
    pub(crate) particle: f64,
    /// Of a contact: resolution, of the pairs without contact too, and force [s].
    pub(crate) contact: f64,
    /// Of a message [s].
    pub(crate) latency: f64,
    /// [B/s].
    pub(crate) bandwidth: f64,
}

impl Costs {
    /// Time of a rank's own work [s].
    fn work(&self, counts: &Counts) -> f64 {
        (counts[PARTICLES] + counts[GHOSTS]) * self.particle + counts[CONTACTS] * self.contact
    }

    /// Time of a rank's step, nothing of the communication hidden behind the work [s].
    pub(crate) fn step(&self, counts: &Counts, ranks: f64) -> f64 {
        self.work(counts)
            + counts[MESSAGES] * self.latency
            + counts[BYTES] / self.bandwidth
            + counts[REDUCTIONS] * self.latency * ranks.log2()
    }

    /// Time of the slowest rank over that of one rank with an equal share of `alone`, inverted.
    pub(crate) fn efficiency(&self, run: &Run, alone: &Run) -> f64 {
        let ranks = run.ranks.len() as f64;
        let share =
            self.work(&alone.ranks[0]) * run.total(PARTICLES) / alone.total(PARTICLES) / ranks;
        share / run.ranks.iter().map(|counts| self.step(counts, ranks)).fold(0.0, f64::max)
    }
}

/// `a n^(2/3) + b`: what grows with the surface of a rank's share of n particles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) a: f64,
    pub(crate) b: f64,
}

impl Surface {
    /// The least squares of the relative residuals over points (n, value).
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

/// What a rank with n particles in the midst of others counts.
pub(crate) struct Laws {
    pub(crate) ghosts: Surface,
    pub(crate) bytes: Surface,
    /// Contacts beyond those of a rank alone: with ghosts, both owners resolve them.
    pub(crate) shared: Surface,
    /// Of n particles alone, per particle.
    pub(crate) contacts: f64,
    /// The most that any rank counted.
    pub(crate) messages: f64,
    pub(crate) reductions: f64,
}

impl Laws {
    /// From runs whose every rank has neighbours on all sides, and one rank alone.
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

    /// What a rank with n particles counts.
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

    /// Of n particles per rank, all ranks with the same work.
    pub(crate) fn efficiency(&self, costs: &Costs, n: f64, ranks: f64) -> f64 {
        let mut alone = Counts::default();
        alone[PARTICLES] = n;
        alone[CONTACTS] = n * self.contacts;
        costs.work(&alone) / costs.step(&self.counts(n), ranks)
    }
}

/// Contacts per rank beyond `contacts` per particle.
pub(crate) fn shared(run: &Run, contacts: f64) -> f64 {
    run.mean(CONTACTS) - contacts * run.mean(PARTICLES)
}
