//! Text of a suggestion.

use super::estimate::{self, Expected, Floor, Rung};
use super::trial::{Answer, SOFTER, TrialError, Trials};
use super::{COPIES, FINER, Question};
use crate::scene::Scene;

type Keys = &'static [(&'static str, &'static str)];
type TrialResult = Result<(Expected, Answer), TrialError>;

/// All results.
pub(super) struct Found<'a> {
    pub(super) question: &'a Question<'a>,
    pub(super) trials: &'a Trials<'a>,
    pub(super) rungs: &'a [Rung],
    pub(super) floor: Floor,
    pub(super) is_kept: bool,
    /// Run with the proposed settings.
    pub(super) run: Answer,
    /// Run with the same step and `auto`.
    pub(super) plain: &'a Answer,
    pub(super) method: Keys,
    pub(super) expected: Expected,
    /// Other methods.
    pub(super) others: Vec<(Keys, TrialResult)>,
    pub(super) softer: Option<TrialResult>,
}

impl Found<'_> {
    pub(super) fn page(&self) -> String {
        let mut lines = vec![self.heading()];
        let of_rung = |k| of_rung(self.trials, self.rungs, k);
        lines.extend((0..self.rungs.len()).map(of_rung));
        lines.extend(self.others.iter().map(|(keys, tried)| {
            let run = tried.clone().map(|(_, run)| run);
            of_method(keys, &run)
        }));
        lines.push(String::new());
        lines.push(self.scene_lines());
        lines.push(self.error_line());
        lines.push(self.floor_line());
        lines.push(self.how_sure());
        lines.push(self.run_time());
        lines.extend(self.softer.iter().map(|tried| self.softer_line(tried)));
        lines.join("\n")
    }

    fn heading(&self) -> String {
        let Self { trials, .. } = self;
        let whole = if trials.time() > 0.99 * trials.left { ", the rest of the stage" } else { "" };
        format!(
            "{}: trials of {} particles over {:.3e} s{whole}; stress and contacts are means over the last fifth",
            trials.scene.title,
            trials.particles,
            trials.time()
        )
    }

    /// Lines of TOML for the scene.
    fn scene_lines(&self) -> String {
        let Self { trials, run, method, .. } = self;
        let scene: &Scene = &trials.scene;
        let steps = trials.behind + (trials.left / run.dt).ceil() as u64;
        let mut lines = vec!["[time]".to_owned(), format!("step = {:e}", run.dt)];
        if scene.duration.is_none() {
            lines.push(format!("steps = {steps}"));
        }
        lines.push("[contact]".to_owned());
        lines.extend(method.iter().map(|(key, value)| format!("{key} = {value}")));
        let scaled = |every: u64| (every as f64 * scene.dt / run.dt).round().max(1.0);
        let rhythms =
            [("snapshot_every", scene.snapshot_every), ("history_every", scene.history_every)];
        let rhythms: Vec<String> = rhythms
            .into_iter()
            .filter(|(_, every)| *every > 0)
            .map(|(key, every)| format!("{key} = {}", scaled(every)))
            .collect();
        if !rhythms.is_empty() {
            lines.push("[output]".to_owned());
            lines.extend(rhythms);
        }
        if let Some(rain) = &scene.rain {
            lines.push("[fill.rain]".to_owned());
            lines.push(format!("every = {}", trials.rain_every(rain, run.dt)));
        }
        lines.join("\n") + "\n"
    }

    fn error_line(&self) -> String {
        let Self { expected, question, .. } = self;
        let Expected { stress, contacts, energy } = *expected;
        let what = format!(
            "stress {}, contacts {}, energy {}",
            percent(stress),
            percent(contacts),
            percent(energy)
        );
        let asked = percent(question.error);
        if self.is_kept {
            format!("error      about {what}; requested: {asked}")
        } else if self.floor.largest() > question.error {
            format!(
                "error      {what}; requested: {asked}. For single values no step can reach this, because runs from \
                 similar starts differ by more. The step above is for means over many runs, where its error is within \
                 the floor"
            )
        } else {
            format!("error      {what}; requested: {asked}. No step in the trials reaches this")
        }
    }

    fn floor_line(&self) -> String {
        let Floor { stress, contacts } = self.floor;
        format!(
            "floor      stress {}, contacts {}: 95 % of differences between runs whose starts differ by 1e-9 of a \
             radius",
            percent(stress),
            percent(contacts)
        )
    }

    fn how_sure(&self) -> String {
        let Self { expected, question, .. } = self;
        let part = expected.largest() / question.error;
        let word = if !self.is_kept {
            "not kept".to_owned()
        } else if part <= 0.5 {
            format!("good: the expected error is {:.0} % of the requested one", 100.0 * part)
        } else {
            format!("marginal: the expected error is {:.0} % of the requested one", 100.0 * part)
        };
        let runs: usize = self.rungs.iter().map(|rung| rung.runs.len()).sum();
        format!(
            "how sure   {word}; {runs} trials of this start, {COPIES} of each longer step. The expected error is \
             twice the largest difference from shorter steps, with the floor in quadrature. In 40 comparisons with \
             converged runs, 39 suggestions were within the requested error; single errors were up to 3.8 times the \
             expected ones"
        )
    }

    fn run_time(&self) -> String {
        let Self { run, trials, .. } = self;
        let per_step = run.seconds / run.steps as f64;
        let steps = (trials.left / run.dt).ceil();
        format!(
            "run time   {:.3} s on one rank for at most {steps} remaining steps, {:.2e} s each, from the trials",
            per_step * steps,
            per_step
        )
    }

    fn softer_line(&self, tried: &TrialResult) -> String {
        match tried {
            Ok((expected, run)) => format!(
                "softer     {SOFTER} of the stiffness with {:.2} times the step: {:.2} of the time; error about \
                 stress {}, contacts {}, energy {}; largest overlap {} of the axis instead of {}",
                run.dt / self.plain.dt,
                run.seconds / self.plain.seconds,
                percent(expected.stress),
                percent(expected.contacts),
                percent(expected.energy),
                percent(run.largest_overlap),
                percent(self.run.largest_overlap)
            ),
            Err(why) => format!("softer     {SOFTER} of the stiffness: {why}"),
        }
    }
}

/// Comparison of a step of the ladder with the shorter ones that have run.
pub(super) fn of_rung(trials: &Trials, rungs: &[Rung], k: usize) -> String {
    let rung = &rungs[k];
    let Some(run) = rung.runs.first() else {
        let why = rung.why_not.as_deref().unwrap_or_default();
        return format!("  step {:.3e} s: {why}", trials.first / 2.0_f64.powi(k as i32));
    };
    let seconds: f64 = rung.runs.iter().map(|run| run.seconds).sum();
    let name = format!("  step {:.4e} s, {:.4} of the limit", run.dt, run.dt / trials.limit);
    let missing = percent(run.missing.abs());
    let compared = match estimate::difference(rungs, k) {
        Some(d) if k + FINER < rungs.len() => format!(
            "differs from shorter steps by stress {}, contacts {}",
            percent(d.stress),
            percent(d.contacts)
        ),
        _ => format!("stress x volume {:.4e} J, contacts {:.4}", run.stress, run.coordination),
    };
    format!("{name}: {compared}; energy error {missing}; {} runs, {seconds:.2} s", rung.runs.len())
}

/// Result of another method.
pub(super) fn of_method(keys: &[(&str, &str)], tried: &Result<Answer, TrialError>) -> String {
    let name: Vec<String> = keys.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    let name = name.join(", ");
    match tried {
        Ok(run) => format!(
            "  {name}: stress x volume {:.4e} J, contacts {:.4}; energy error {}; {:.2} s",
            run.stress,
            run.coordination,
            percent(run.missing.abs()),
            run.seconds
        ),
        Err(why) => format!("  {name}: {why}"),
    }
}

fn percent(part: f64) -> String {
    format!("{:.3} %", 100.0 * part)
}
