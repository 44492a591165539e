//! Results of the audit of contacts, part of [`super::Report`].

use serde::Serialize;

/// Errors of the contacts of this run. At regular intervals a sample of the touching contacts is resolved again, to
/// convergence.
/// The figures do not depend on the number of ranks.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Audit {
    /// Steps between audits; 0 without audits.
    pub every: u64,
    /// Seed of the samples.
    pub seed: u64,
    /// Number of audits in this run.
    pub audits: u64,
    /// Number of contacts resolved again.
    pub contacts: u64,
    /// True if the scene has unions, whose contacts are left out.
    pub without_unions: bool,
    /// Errors by the kinds of the two shapes.
    pub of_kinds: Vec<KindErrors>,
}

/// Errors of contacts between shapes of two kinds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KindErrors {
    /// Names of the two kinds, as in a scene.
    pub kinds: [&'static str; 2],
    /// Method of the run: the first of its chain.
    pub method: &'static str,
    /// Reference method.
    pub against: &'static str,
    /// Number of contacts resolved again.
    pub contacts: u64,
    /// Number of these that overlap in the run, but not when resolved again. They count in the errors of overlap (as a lower
    /// bound) and force, not in those of normal, point and relative overlap. Contacts held across a gap by adhesion have these
    /// two errors, too.
    pub spurious: u64,
    /// Number of contacts that could not be resolved again; they have no errors.
    pub unresolved: u64,
    /// Mean elastic normal force when resolved again, without spurious contacts: the unit of `force`.
    pub mean_force_n: f64,
    /// Error of the overlap over the shortest axis (a diameter) of the smaller body.
    pub overlap: Spread,
    /// Error of the overlap over the overlap.
    pub relative_overlap: Spread,
    /// Angle between the normals.
    pub normal_rad: Spread,
    /// Distance of the contact points over that axis.
    pub point: Spread,
    /// Error of the normal force that follows from the overlap, without dashpots, over `mean_force_n`.
    pub force: Spread,
}

/// Distribution of errors, none of them negative; all `null` if there are none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Half of the errors are at most this.
    pub median: f64,
    /// 99 of 100 errors are at most this.
    pub p99: f64,
    /// Largest error.
    pub max: f64,
}
