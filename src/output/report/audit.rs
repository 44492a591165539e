//! What the audit of contacts has found, as [`super::Report`] has it.

use serde::Serialize;

/// Errors of contacts of this run: every so many steps a sample of the contacts that touch was resolved again, to convergence.
/// The figures do not depend on the number of ranks.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Audit {
    /// Steps between audits; 0: there are none.
    pub every: u64,
    /// Seed of the samples.
    pub seed: u64,
    /// How many audits there were in this run.
    pub audits: u64,
    /// Contacts that were resolved again.
    pub contacts: u64,
    /// Are there unions, whose contacts are left out?
    pub without_unions: bool,
    /// By the kinds of the two shapes.
    pub of_kinds: Vec<OfKinds>,
}

/// Errors of contacts between shapes of two kinds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfKinds {
    /// Their names, as in a scene.
    pub kinds: [&'static str; 2],
    /// What resolved them in the run, first of its chain.
    pub method: &'static str,
    /// Against what they were held.
    pub against: &'static str,
    /// How many were resolved again.
    pub contacts: u64,
    /// How many of these overlap in the run, but not when resolved again. They have an error of the overlap (at least) and of
    /// the force; no normal, no point, no relative overlap. Contacts that adhesion holds across a gap have these two, too.
    pub spurious: u64,
    /// How many could not be resolved again; they have no errors.
    pub unresolved: u64,
    /// Mean size of the elastic normal force, as it is when resolved again, without spurious ones: the unit of `force`.
    pub mean_force_n: f64,
    /// Error of the overlap over the shortest axis (a diameter) of the smaller body.
    pub overlap: Spread,
    /// Error of the overlap over the overlap.
    pub relative_overlap: Spread,
    /// Angle between the normals.
    pub normal_rad: Spread,
    /// Distance of the contact points over that axis.
    pub point: Spread,
    /// Error of the normal force that the law makes of the overlap, dashpots left out, over `mean_force_n`.
    pub force: Spread,
}

/// Of many errors, none of them negative; all `null` if there are none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Half are at most this.
    pub median: f64,
    /// 99 of 100 are at most this.
    pub p99: f64,
    /// All are at most this.
    pub max: f64,
}
