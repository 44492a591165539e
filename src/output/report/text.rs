//! The report as text.

use super::audit::{Audit, KindErrors, Spread};
use super::sizes::SizesOf;
use super::{DissipatedBy, Ended, Least, Memory, Ranks, Report, Share, Spent};
use crate::drive::Kept;
use crate::text::counted;
use crate::timing::Phase;
use std::fmt::{Display, Formatter, Write};
use std::path::Path;

/// Lines of text.
#[derive(Default)]
struct Page(String);

impl Page {
    fn line(&mut self, line: impl Display) {
        let _ = writeln!(self.0, "{line}");
    }
}

impl Report {
    /// Summary in four lines: steps and speed; contacts and fallbacks; energy; snapshot. Warnings and the time lost to other
    /// programs follow. `directory` is the folder of the report.
    pub fn summary(&self, directory: &Path) -> String {
        let mut page = Page::default();
        self.steps(&mut page);
        self.contacts(&mut page);
        self.energy(&mut page);
        page.line(format_args!(
            "snapshot   {}; all figures: {}",
            self.run.snapshot.display(),
            Self::path(directory).display()
        ));
        for warning in &self.warnings {
            page.line(format_args!("warning    {warning}"));
        }
        if let Some(words) = self.ranks.lack_of_cores(self.run.wall_s) {
            page.line(format_args!("cores      {words}"));
        }
        page.0
    }

    /// All further figures of the report.
    pub fn details(&self) -> String {
        let mut page = Page::default();
        self.times(&mut page);
        page.line("");
        self.costs(&mut page);
        page.line("");
        self.audit.write(&mut page);
        self.ranks.write(&mut page);
        self.memory.write(&mut page);
        for target in &self.targets {
            page.line(target);
        }
        for sizes in &self.sizes {
            page.line(sizes);
        }
        for (name, number) in &self.counted {
            page.line(format_args!("counted    {name} = {number}"));
        }
        self.state(&mut page);
        page.0
    }

    fn steps(&self, page: &mut Page) {
        let run = &self.run;
        let how = match run.ended {
            Ended::AllStepsDone => "all steps done",
            Ended::ByStop => "[stop] reached",
            Ended::BySignal => "stopped by a signal",
        };
        page.line(format_args!(
            "steps      {how}: {} steps, to step {} ({:.6} s), of {} particles, in {:.1} s on {}; {:.3e} particle-steps \
             per second ({:.3} µs per particle-step and rank)",
            run.steps,
            run.last_step,
            run.time_s,
            run.particles,
            run.wall_s,
            counted(run.ranks, "rank"),
            run.particle_steps_per_s,
            1e-3 * run.ns_per_particle_step,
        ));
    }

    fn contacts(&self, page: &mut Page) {
        let contacts = &self.contacts;
        if contacts.contacts == 0 {
            page.line("contacts   none");
            return;
        }
        let ns = self.spent(Phase::Contacts).map_or(0.0, |spent| spent.ns_per_contact);
        let passed_on: u64 = contacts.fallbacks.iter().sum();
        let fallbacks = if passed_on == 0 {
            "no fallbacks".to_owned()
        } else {
            let stages = contacts.fallbacks.iter().enumerate().filter(|&(_, &pairs)| pairs > 0);
            let of_stages: Vec<String> =
                stages.map(|(k, pairs)| format!("{pairs} to fallback {}", k + 1)).collect();
            format!(
                "{:.2} per million pairs not resolved by the first method, {}",
                1e6 * contacts.fallback_share,
                of_stages.join(", "),
            )
        };
        page.line(format_args!(
            "contacts   {:.3e} over all steps, {:.3e} per second, {ns:.1} ns each; {fallbacks}",
            contacts.contacts as f64, contacts.contacts_per_s,
        ));
    }

    fn energy(&self, page: &mut Page) {
        let energy = &self.energy;
        let part = |part: Option<f64>, of: &str| {
            part.map_or_else(String::new, |part| {
                // A share that rounds to nothing has no sign.
                let percent = (1e6 * part).round() / 1e4 + 0.0;
                format!(", {percent:.4} % of the {of}")
            })
        };
        page.line(format_args!(
            "energy     error {:.1e} J{}{}",
            energy.missing_j,
            part(energy.missing_over_dissipated, "dissipated"),
            part(energy.missing_over_moved, "largest kinetic and elastic"),
        ));
    }

    /// Time by phase.
    fn times(&self, page: &mut Page) {
        page.line(format_args!(
            "{:<10} {:>7} {:>10} {:>14} {:>14}",
            "phase", "share", "µs/step", "slowest rank", "fastest rank"
        ));
        for (phase, spent) in &self.phases {
            page.line(format_args!(
                "{:<10} {:>6.1}% {:>10.2} {:>12.2} s {:>12.2} s",
                phase.name(),
                100.0 * spent.share,
                spent.us_per_step,
                spent.slowest_rank_s,
                spent.fastest_rank_s,
            ));
        }
    }

    /// Time of a rank in the phases of a step that grow with its particles, beside the lower bound from their formulas.
    fn costs(&self, page: &mut Page) {
        page.line(format_args!(
            "{:<10} {:>11} {:>12} {:>11} {:>14} {:>9} {:>17} {:>12}",
            "ns",
            "a particle",
            "listed pair",
            "contact",
            "at least: ops",
            "bytes",
            "reached: ops/ns",
            "bytes/ns"
        ));
        for phase in [Phase::Move, Phase::Contacts, Phase::Forces] {
            let Some(spent) = self.spent(phase) else { continue };
            let Spent { ns_per_particle_step, ns_per_listed_pair, ns_per_contact, .. } = spent;
            let measured = format!(
                "{:<10} {ns_per_particle_step:>11.2} {ns_per_listed_pair:>12.2} {ns_per_contact:>11.2}",
                phase.name(),
            );
            let Some(least) = &spent.least else {
                page.line(format_args!("{measured}   no lower bound is known for these shapes"));
                continue;
            };
            let Least {
                operations_per_particle_step,
                bytes_per_particle_step,
                operations_per_ns,
                bytes_per_ns,
            } = least;
            page.line(format_args!(
                "{measured} {operations_per_particle_step:>14.1} {bytes_per_particle_step:>9.1} {operations_per_ns:>17.3} \
                 {bytes_per_ns:>12.3}",
            ));
        }
        page.line(
            "at least: the minimum of the formulas per particle and step; reached: that over the time",
        );
        let contacts = &self.contacts;
        page.line(format_args!(
            "pairs      {:.3e} listed, {:.1} % of them resolved",
            contacts.listed_pairs as f64,
            100.0 * contacts.resolved_pairs as f64 / contacts.listed_pairs.max(1) as f64,
        ));
    }

    /// The packing at the end, the energy balance, and the time step.
    fn state(&self, page: &mut Page) {
        let (packing, energy, resolution) = (&self.packing, &self.energy, &self.resolution);
        page.line(format_args!(
            "packing    {:.3} contacts per particle with walls, {}",
            packing.coordination,
            if packing.contacts == 0 {
                "none between particles".to_owned()
            } else {
                format!("mean normal force between particles {:.3e} N", packing.mean_normal_force_n)
            },
        ));
        page.line(format_args!(
            "balance    received {:.6e} J = kinetic {:.3e} + gravity {:.6e} + stored {:.3e} + of the steps {:.1e} + \
             dissipated {:.6e} + error {:.1e}",
            energy.received_j,
            energy.kinetic_j,
            energy.gravity_j,
            energy.stored_j,
            energy.step_j,
            energy.dissipated_j,
            energy.missing_j,
        ));
        let DissipatedBy {
            normal_dashpots_j,
            tangential_dashpots_j,
            friction_j,
            turning_j,
            damping_j,
            adhesion_j,
        } = energy.dissipated_by;
        page.line(format_args!(
            "dissipated by normal dashpots {normal_dashpots_j:.3e} J, tangential dashpots {tangential_dashpots_j:.3e} J, \
             friction {friction_j:.3e} J, rolling and twisting {turning_j:.3e} J, global damping {damping_j:.3e} J, adhesion \
             {adhesion_j:.3e} J"
        ));
        let oscillation = resolution
            .steps_per_oscillation
            .map_or_else(String::new, |steps| format!("{steps:.1} steps per oscillation, "));
        page.line(format_args!(
            "step       {oscillation}largest overlap {:.2e} and largest displacement in a step {:.2e} of a radius, \
             largest rotation {:.2e} rad",
            resolution.largest_overlap_over_radius,
            resolution.largest_move_over_radius,
            resolution.largest_turn_rad,
        ));
    }
}

impl Display for Kept {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        write!(
            f,
            "{:<10} {}: mean {:.5e} {unit} of {:e} {unit} over the last {} steps of the stage; error {:.3} % in the \
             mean, at most {:.3} %",
            self.drive,
            self.of,
            self.mean,
            self.target,
            self.steps,
            100.0 * self.mean_error,
            100.0 * self.largest_error,
            unit = self.unit,
        )
    }
}

impl Display for SizesOf {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        let tenths = |all: [f64; 3]| all.map(|scale| format!("{scale:.4}")).join(", ");
        let Self { shape, particles, left, asked, found, .. } = self;
        let of_left = if *left > 0 { format!(", {left} of them removed") } else { String::new() };
        write!(
            f,
            "{:<10} {particles} of {shape}{of_left}: by mass 10, 50, 90 % below {} of {} requested; largest \
             difference of the cumulative curves {:.2} % by number, {:.2} % by mass",
            "sizes",
            tenths(found.by_mass_d10_d50_d90),
            tenths(asked.by_mass_d10_d50_d90),
            100.0 * self.largest_difference_by_number,
            100.0 * self.largest_difference_by_mass,
        )
    }
}

impl Audit {
    fn write(&self, page: &mut Page) {
        let unions = if self.without_unions { "; without contacts of unions" } else { "" };
        if self.contacts == 0 {
            page.line(if self.every == 0 {
                "audit      none: audit.every = 0".to_owned()
            } else {
                let every = self.every;
                format!(
                    "audit      no contact was resolved again, from one in {every} steps{unions}"
                )
            });
            return;
        }
        page.line(format_args!(
            "audit      {} contacts of this run resolved again, at {} of its steps{unions}; error: median, 99 of 100, \
             largest",
            self.contacts, self.audits
        ));
        for of_kinds in &self.of_kinds {
            of_kinds.write(page);
        }
    }
}

impl KindErrors {
    fn write(&self, page: &mut Page) {
        let [a, b] = self.kinds;
        let others = |count: u64, what: &str| {
            if count == 0 { String::new() } else { format!(", {count} {what}") }
        };
        page.line(format_args!(
            "           {a}-{b}: {} by {}, against {}{}{}",
            self.contacts,
            self.method,
            self.against,
            others(self.spurious, "do not touch"),
            others(self.unresolved, "could not be resolved again"),
        ));
        let Self { overlap, normal_rad, point, force, .. } = self;
        page.line(format_args!(
            "             overlap {overlap} of the short axis; normal {normal_rad} rad; point {point}; force {force} of the mean",
        ));
    }
}

impl Display for Spread {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        write!(f, "{:.1e}, {:.1e}, {:.1e}", self.median, self.p99, self.max)
    }
}

impl Display for Share {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        let digits = if self.most < 100.0 { 2 } else { 0 };
        write!(f, "{:.digits$} (most {:.digits$})", self.mean, self.most)
    }
}

impl Ranks {
    fn write(&self, page: &mut Page) {
        page.line(format_args!(
            "halo       per step and rank {} messages, one per neighbour, and {} bytes, {:.0} per ghost; list rebuilt {} times, \
             domain cut {} times, {} particles migrated",
            self.messages_per_step,
            self.bytes_per_step,
            self.bytes_per_ghost,
            self.rebuilds,
            self.recuts,
            self.migrated,
        ));
        page.line(format_args!(
            "ghosts     {} per owned particle, of {} within the halo width (largest bounding diameter and skin) around its \
             subdomain",
            self.ghosts_per_owned, self.within_halo_per_owned,
        ));
        page.line(format_args!(
            "work       the busiest rank has {:.3} times the mean",
            self.imbalance
        ));
    }

    /// Warning that a rank had to wait for a core, if `wall_s` is long enough for this to matter.
    fn lack_of_cores(&self, wall_s: f64) -> Option<String> {
        let part = self.without_core_s?.most / wall_s;
        (part > 0.1 && wall_s > 10.0).then(|| {
            format!(
                "a rank waited for a core {:.0} % of the time: there are more ranks than cores, or other programs use \
                 them. Open MPI binds all jobs to the same first cores: use `mpirun --bind-to none`",
                100.0 * part
            )
        })
    }
}

impl Memory {
    fn write(&self, page: &mut Page) {
        page.line(format_args!(
            "memory     {} bytes per owned particle: {:.0} in columns, {:.0} in {:.2} listed pairs, {:.0} in {:.2} contacts",
            self.bytes_per_owned,
            self.column_bytes_per_owned,
            self.pair_bytes_per_owned,
            self.pairs_per_owned,
            self.contact_bytes_per_owned,
            self.contacts_per_owned,
        ));
        if let (Some(peak), Some(per_owned)) = (self.peak_bytes, self.peak_bytes_per_owned) {
            let megabytes = Share { mean: 1e-6 * peak.mean, most: 1e-6 * peak.most };
            page.line(format_args!(
                "peak       {megabytes} MB in a process, {per_owned} bytes per owned particle: including the program, \
                 its libraries, and temporary data",
            ));
        }
    }
}
