//! Statements of the paper, numbers of this code beside them, and verdicts that follow from the
//! numbers.

use super::Plan;
use super::statistics::{Summary, mean, share};
use super::study::{
    ALONE, AtOffset, CENTRE_LINE, CHECKED, ELLIPSOIDS, EPA, EROSION, FINE_EROSION, InCase1,
    InCase2, InCase3, NORMAL, POLISHED_EPA, RATIO, SPHERES, Study, TIGHT, Times,
};
use crate::cases::OFFSET;
use crate::findings::{Finding, Kind, Reading, Row, Verdict, table};
use dem_mpi::contact::{Epa, ErodedGjk};
use dem_mpi::post::report::readable;
use std::fmt::Write;

/// Page of the section, as Markdown.
pub fn report(study: &Study, plan: &Plan) -> String {
    let mut page = format!(
        "# Section 2 of Lai et al. (2021), regenerated\n\n\
         Z. Lai, S. Zhao, J. Zhao, L. Huang, *Revisiting the GJK and shape erosion method for contact \
         resolution in DEM*, Powder Technology (2021), section 2. Two ellipsoids, short axis 1 m; erosion of \
         {} % of each body and 1 % more until they are apart; GJK run to rounding, so that what is left is the \
         erosion's error. The exact answers are this code's common normal, which agrees with 50-digit \
         references to rounding. Case III and table 1: {} random pairs each, seed {}.\n\n\
         Written by `lai2021 section-2`; the verdicts follow from the numbers. Erosion is asked about all pairs \
         here; asked only where GJK finds bodies touching it gives the same contacts, but for the row of Fig. 3 and \
         table 1: `findings.csv` has the verdicts on both.\n",
        100.0 * RATIO,
        plan.count,
        plan.seed,
    );
    for topic in topics(study, Reading::Alone) {
        let Topic { title, figure, kind, findings, remark } = topic;
        let whose = if kind == Kind::Check { "the check" } else { "the paper" };
        let times = if remark == TABLE_1 { table_1(&study.times) } else { String::new() };
        let _ =
            write!(page, "\n## {title}\n\n{figure}{times}{}\n{remark}", table(whose, &findings));
    }
    page
}

/// All findings with both readings of erosion.
pub fn rows(study: &Study) -> Vec<Row> {
    let mut rows = Vec::new();
    for reading in Reading::ALL {
        for topic in topics(study, reading) {
            let row = |finding| Row::new(topic.title, topic.kind, reading, finding);
            rows.extend(topic.findings.into_iter().map(row));
        }
    }
    rows
}

/// Findings on one topic.
struct Topic {
    title: &'static str,
    /// The figure, as Markdown.
    figure: &'static str,
    kind: Kind,
    findings: Vec<Finding>,
    remark: &'static str,
}

fn topics(study: &Study, reading: Reading) -> Vec<Topic> {
    let topic = |title, figure, findings, remark| Topic {
        title,
        figure,
        kind: Kind::Statement,
        findings,
        remark,
    };
    vec![
        topic(
            "2.2 Case I: parallel ellipsoids",
            "![Fig. 5](fig5.svg)\n\n",
            case_1(study, reading),
            CASE_1,
        ),
        topic(
            "2.2 Why the normal's error changes",
            "![Fig. 6](fig6.svg)\n\n",
            reason(study),
            REASON,
        ),
        topic(
            "2.2 Case II: elongation and angle",
            "![Fig. 7](fig7.svg)\n\n",
            case_2(&study.case_2),
            CASE_2,
        ),
        topic("2.2 Case III: random pairs", "![Fig. 8](fig8.svg)\n\n", case_3(study), CASE_3),
        topic("2.2 Table 1: time of a pair", "", times(&study.times, reading), TABLE_1),
        Topic {
            kind: Kind::Check,
            ..topic("Checks for the conclusions", "", checks(study), CHECKS)
        },
    ]
}

const CASE_1: &str = "\
Tables: `fig5.csv`. The relative error has no upper bound, because its numerator stays the same while the overlap goes to \
zero: what the paper reports as 100 % is where its plot begins.\n";
const REASON: &str = "\
Tables: `fig6.csv`, `fig6_deeper.csv`. The paper explains a decrease by two extremes: beside each other (a, left) the \
normal is off, on top of each other (a, right) it is exact. True, but the way from one to the other is not monotonic: \
at the paper's offset y = 0.35 m the error first grows with the overlap (b), and as soon as 5 % do not part the cores, each further \
percent of erosion adds to it (c). It falls from the first touch only where B already stands higher.\n";
const CASE_2: &str = "Table: `fig7.csv`.\n";
const CASE_3: &str = "\
Tables: `fig8.csv`, `fig8_summary.csv`. The paper does not say how its pairs were drawn. Two ways stand beside each other, centre \
line or contact normal uniform over the sphere; the place of B uniform in space lies between them. The mean is near 1e-3 in \
neither, and the middle of the paper's own range, 1e-5 to 10, is 1e-2. Erosion that begins at 1 % does have a mean of 1e-3, \
but contradicts the range and the 3° of the same paragraph.\n";
const TABLE_1: &str = "\
Table: `table1.csv`. The paper's numbers are given in ms; only ratios can be compared, and they depend on two tolerances that the \
paper does not tell. One pair after the other, without a guess; *warm*: from a normal that is off by 1e-4, as after a time step; \
*batched*: many pairs at once, as in a simulation. The paper's methods both begin with GJK on the bodies themselves. Here \
erosion goes to the cores at once, which saves a run of GJK where bodies touch and costs more where they are apart; *GJK + \
GJK-erosion* has the paper's answers, but looks at the bodies themselves last, and only where erosion finds a contact. The \
findings below are of *GJK-erosion*; `findings.csv` has both.\n";

const CHECKS: &str = "\
Section 4 of the paper states these; its section 2 does not.\n";

/// Clearance that counts as zero [m].
const ROUNDING: f64 = 1e-12;

fn case_1(study: &Study, reading: Reading) -> Vec<Finding> {
    let rows: Vec<&InCase1> =
        study.case_1.iter().filter(|row| row.erosion_ratio == RATIO).collect();
    let point = largest(&rows, |row| row.point_error_m);
    let mut findings = overlaps_in_case_1(&rows, study.twice);
    findings.extend(normals_in_case_1(&rows));
    findings.push(Finding {
        name: "point_exact",
        figure: "5c",
        statement: "the contact point is exact, by symmetry",
        here: format!("off by {} m at most", readable(point)),
        verdict: Verdict::of(point < 1e-14),
    });
    findings.push(spurious(study.spurious[reading as usize]));
    findings
}

/// Largest value of a number over all rows; 0 if none is positive.
fn largest(rows: &[&InCase1], pick: fn(&InCase1) -> f64) -> f64 {
    rows.iter().map(|row| pick(row)).fold(0.0, f64::max)
}

/// Whether a number decreases from each row to the next.
fn falls(rows: &[&InCase1], pick: fn(&InCase1) -> f64) -> bool {
    rows.windows(2).all(|w| pick(w[1]) < pick(w[0]))
}

/// Findings on overlaps; `twice` is the overlap at which the relative error is 100 % [m].
fn overlaps_in_case_1(rows: &[&InCase1], twice: f64) -> Vec<Finding> {
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    let excess = |row: &InCase1| row.overlap_found_m - row.overlap_m;
    let (low, high) = (excess(first), largest(rows, excess));
    vec![
        Finding {
            name: "touch",
            figure: "5a",
            statement: "bodies that just touch are given an overlap of about 0.001 m",
            here: format!("{} m", readable(first.overlap_found_m)),
            verdict: Verdict::of((0.95e-3..1.05e-3).contains(&first.overlap_found_m)),
        },
        Finding {
            name: "relative_error",
            figure: "5a",
            statement: "the relative error falls with the overlap, to about 2 % at an overlap of 5 %",
            here: format!("{} %", readable(100.0 * last.relative_overlap_error)),
            verdict: Verdict::of(
                falls(rows, |row| row.relative_overlap_error)
                    && (0.015..0.025).contains(&last.relative_overlap_error),
            ),
        },
        Finding {
            name: "hundred_percent",
            figure: "5a",
            statement: "it reaches as much as 100 % for small overlaps",
            here: format!(
                "100 % at {} m, more below: the error itself stays at {} to {} m",
                readable(twice),
                readable(low),
                readable(high)
            ),
            verdict: if twice > 0.0 { Verdict::Nearly } else { Verdict::No },
        },
        Finding {
            name: "overestimated",
            figure: "5a",
            statement: "overlaps are over-estimated",
            here: format!("in all {} pairs", rows.len()),
            verdict: Verdict::of(rows.iter().all(|row| excess(row) > 0.0)),
        },
    ]
}

fn normals_in_case_1(rows: &[&InCase1]) -> [Finding; 2] {
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    let normal = mean(rows.iter().map(|row| row.normal_error_deg));
    [
        Finding {
            name: "normal_3_deg",
            figure: "5b",
            statement: "the normal's error is about 3° on average and varies little",
            here: format!(
                "mean {}°, from {}° to {}°",
                readable(normal),
                readable(first.normal_error_deg),
                readable(last.normal_error_deg)
            ),
            verdict: Verdict::of((2.5..3.5).contains(&normal)),
        },
        Finding {
            name: "normal_decreases",
            figure: "5b",
            statement: "the normal's error decreases with the overlap",
            here: format!(
                "it goes from {}° to {}°",
                readable(first.normal_error_deg),
                readable(last.normal_error_deg)
            ),
            verdict: Verdict::of(falls(rows, |row| row.normal_error_deg)),
        },
    ]
}

/// Finding on spurious contacts; `clearance` is the largest at which a pair is found touching [m].
fn spurious(clearance: f64) -> Finding {
    Finding {
        name: "spurious",
        figure: "3",
        statement: "pairs of small clearance may be called touching",
        here: if clearance > ROUNDING {
            format!("clearances below {} m are", readable(clearance))
        } else {
            "none is: GJK has found them apart before".into()
        },
        verdict: Verdict::of(clearance > ROUNDING),
    }
}

/// Conclusions of section 4 that go beyond section 2.
fn checks(study: &Study) -> Vec<Finding> {
    let with = |ratio| move |row: &&InCase1| row.erosion_ratio == ratio;
    // The second row: the first has an overlap of zero.
    let small = study.case_1.iter().filter(with(RATIO)).nth(1);
    let mut ratios = Study::RATIOS.to_vec();
    ratios.sort_by(f64::total_cmp);
    let touch = |&ratio: &f64| study.case_1.iter().find(with(ratio)).map(|row| row.overlap_found_m);
    let touches: Vec<f64> = ratios.iter().filter_map(touch).collect();
    let told = ratios.iter().zip(&touches);
    let told =
        told.map(|(ratio, found)| format!("{} m at {:.0} %", readable(*found), 100.0 * ratio));
    let newton = row(&study.times, "common normal", None).contact_ns;
    let erosion = row(&study.times, ALONE, Some(ErodedGjk::default().tolerance)).contact_ns;
    vec![
        Finding {
            name: "beyond_100_percent",
            figure: "5a",
            statement: "the relative error of small overlaps is 100 % or higher",
            here: format!("higher below an overlap of {} m", readable(study.twice)),
            verdict: Verdict::of(small.is_some_and(|row| row.relative_overlap_error >= 1.0)),
        },
        Finding {
            name: "ratio_too_large",
            figure: "5a",
            statement: "a larger erosion ratio overestimates overlaps more",
            here: format!("bodies that just touch: {}", told.collect::<Vec<_>>().join(", ")),
            verdict: Verdict::of(touches.windows(2).all(|w| w[1] > 2.0 * w[0])),
        },
        Finding {
            name: "gradients",
            figure: "T1",
            statement: "optimisation by gradients is faster still",
            here: format!(
                "Newton's method for the common normal takes {:.2} of erosion's time",
                newton / erosion
            ),
            verdict: Verdict::of(newton < erosion),
        },
    ]
}

fn reason(study: &Study) -> Vec<Finding> {
    // Change of the error from touch to the largest overlap, by offset.
    let change = |y: f64| {
        let rows: Vec<&AtOffset> =
            study.offsets.iter().filter(|row| (row.y_m - y).abs() < 1e-9).collect();
        rows[rows.len() - 1].normal_error_deg - rows[0].normal_error_deg
    };
    let mut offsets: Vec<f64> = study.offsets.iter().map(|row| row.y_m).collect();
    offsets.dedup();
    let falling: Vec<f64> = offsets.iter().copied().filter(|&y| change(y) < 0.0).collect();
    let lowest = falling.first().copied().unwrap_or(f64::NAN);
    let deepest = study.deeper.last().map_or(f64::NAN, |row| row.normal_error_deg);
    let touch = study.deeper.first().map_or(f64::NAN, |row| row.normal_error_deg);
    vec![
        Finding {
            name: "towards_top",
            figure: "6",
            statement: "the error decreases as B moves from beside A towards its top",
            here: format!(
                "from touch to 0.05 m it changes by {:+.3}° at y = {OFFSET} m; it decreases only for y of \
                 {} m and more",
                change(OFFSET),
                readable(lowest)
            ),
            verdict: Verdict::of(change(OFFSET) < 0.0),
        },
        Finding {
            name: "larger_overlaps",
            figure: "6",
            statement: "so it would on the way to larger overlaps",
            here: format!(
                "at y = {OFFSET} m, {}° at touch, {}° at an overlap of 0.3 m, where 5 % no longer part the cores",
                readable(touch),
                readable(deepest)
            ),
            verdict: Verdict::of(deepest < touch),
        },
    ]
}

/// Selects a number of a pair in Case II.
type Pick = fn(&InCase2) -> f64;

/// Rows of Case II for each long axis of 1, 2, 3, 4 m.
struct ByLongAxis<'a>([Vec<&'a InCase2>; 4]);

impl<'a> ByLongAxis<'a> {
    fn new(rows: &'a [InCase2]) -> Self {
        Self([1.0, 2.0, 3.0, 4.0].map(|axis| {
            let of_axis = |row: &&InCase2| row.long_axis_m == axis;
            rows.iter().filter(of_axis).collect()
        }))
    }

    /// For each long axis the row with the largest value of a number.
    fn worst(&self, pick: Pick) -> [&'a InCase2; 4] {
        self.0.each_ref().map(|rows| {
            rows.iter().fold(rows[0], |best, row| if pick(row) > pick(best) { *row } else { best })
        })
    }

    fn grows(&self, pick: Pick) -> bool {
        self.worst(pick).windows(2).all(|w| pick(w[1]) > pick(w[0]))
    }

    /// Largest value of a number for each long axis, in multiples of `1 / unit`.
    fn in_words(&self, pick: Pick, unit: f64) -> String {
        self.worst(pick).map(|row| format!("{:.2}", unit * pick(row))).join(" / ")
    }

    /// Angle of the largest value of a number for the long axes of 2, 3, 4 m.
    fn angles(&self, pick: Pick) -> String {
        let [_, longer @ ..] = self.worst(pick);
        longer.map(|row| format!("{}°", row.angle_deg)).join(", ")
    }

    /// Whether these angles, as angles between axes, are in a range [degrees].
    fn are_near(&self, pick: Pick, low: f64, high: f64) -> bool {
        self.worst(pick)[1..].iter().all(|row| (low..=high).contains(&between_axes(row)))
    }
}

/// Angle between the axes [degrees], at most 90.
fn between_axes(row: &InCase2) -> f64 {
    row.angle_deg.min(180.0 - row.angle_deg)
}

fn case_2(rows: &[InCase2]) -> Vec<Finding> {
    let overlap: Pick = |row| row.relative_overlap_error;
    let normal: Pick = |row| row.normal_error_deg;
    let point: Pick = |row| row.point_error_m;
    let whole = ByLongAxis::new(rows);
    let sphere = overlap(whole.worst(overlap)[0]);
    let mut findings = vec![
        Finding {
            name: "near_spheres",
            figure: "7",
            statement: "near-spheres have next to no error",
            here: format!("long axis 1 m: overlap off by {} at most, relative", readable(sphere)),
            verdict: Verdict::of(sphere < 1e-6),
        },
        Finding {
            name: "elongation",
            figure: "7",
            statement: "the errors grow with elongation",
            here: format!(
                "largest for a long axis of 1 / 2 / 3 / 4 m: overlap {} %, normal {}°, point {} %",
                whole.in_words(overlap, 100.0),
                whole.in_words(normal, 1.0),
                whole.in_words(point, 100.0)
            ),
            verdict: Verdict::of(
                [overlap, normal, point].into_iter().all(|pick| whole.grows(pick)),
            ),
        },
        Finding {
            name: "worst_angle",
            figure: "7a, b",
            statement: "overlap and normal are worst near 0° or 180°",
            here: format!(
                "for 2, 3, 4 m: overlap at {}; normal at {}",
                whole.angles(overlap),
                whole.angles(normal)
            ),
            verdict: Verdict::of(
                whole.are_near(overlap, 0.0, 10.0) && whole.are_near(normal, 0.0, 10.0),
            ),
        },
    ];
    findings.extend(points_in_case_2(rows, &whole));
    findings
}

fn points_in_case_2(rows: &[InCase2], whole: &ByLongAxis) -> [Finding; 4] {
    let point: Pick = |row| row.point_error_m;
    let most_off = point(whole.worst(point)[3]);
    let at_angle = |angle: f64| {
        rows.iter().filter(|row| between_axes(row) == angle).map(point).fold(0.0, f64::max)
    };
    [
        Finding {
            name: "point_45_deg",
            figure: "7c",
            statement: "the contact point is worst at a cross angle of about 45°",
            here: format!("for 2, 3, 4 m: at {}", whole.angles(point)),
            verdict: Verdict::of(whole.are_near(point, 35.0, 55.0)),
        },
        Finding {
            name: "point_5_percent",
            figure: "7c",
            statement: "its offset is up to about 5 % of the short axis",
            here: format!("{} %", readable(100.0 * most_off)),
            verdict: Verdict::of((0.045..0.055).contains(&most_off)),
        },
        Finding {
            name: "point_parallel",
            figure: "7c",
            statement: "it vanishes where the axes are parallel",
            here: format!("{} m at most", readable(at_angle(0.0))),
            verdict: Verdict::of(at_angle(0.0) < 1e-14),
        },
        Finding {
            name: "point_perpendicular",
            figure: "7c",
            statement: "and where they are perpendicular",
            here: format!(
                "{} % at most: small, but the offset y = {OFFSET} m breaks the symmetry",
                readable(100.0 * at_angle(90.0))
            ),
            verdict: if at_angle(90.0) < 0.01 { Verdict::Nearly } else { Verdict::No },
        },
    ]
}

/// Results of the pairs of Case III with one sampling and one method.
fn in_case_3<'a>(study: &'a Study, sampling: &str, method: &str) -> &'a InCase3 {
    let wanted = |c: &&InCase3| c.sampling == sampling && c.method == method;
    study.case_3.iter().find(wanted).expect("the study has all its cases")
}

fn both(a: f64, b: f64) -> String {
    format!("{} and {}", readable(a), readable(b))
}

fn percent(share: f64) -> String {
    format!("{} %", readable(100.0 * share))
}

/// Verdict on a bound that holds for all, for nearly all, or for neither.
fn as_a_bound(all: bool, nearly: bool) -> Verdict {
    match (all, nearly) {
        (true, _) => Verdict::Yes,
        (false, true) => Verdict::Nearly,
        (false, false) => Verdict::No,
    }
}

fn case_3(study: &Study) -> Vec<Finding> {
    let mut findings = overlaps_in_case_3(study);
    findings.extend(normals_and_points_in_case_3(study));
    findings.extend(epa_in_case_3(study));
    findings
}

fn overlaps_in_case_3(study: &Study) -> Vec<Finding> {
    let [lines, normals, fine] =
        [(CENTRE_LINE, EROSION), (NORMAL, EROSION), (CENTRE_LINE, FINE_EROSION)]
            .map(|(sampling, method)| in_case_3(study, sampling, method));
    let [overlap, ..] = lines.summaries();
    let [overlap_n, ..] = normals.summaries();
    let [overlap_fine, normal_fine, _] = fine.summaries();
    let inside = |c: &InCase3| share(&c.overlap, 1e-5, 10.0);
    // "About" means within a factor of two.
    let about = |s: &Summary| (0.5e-3..2e-3).contains(&s.log_mean);
    vec![
        Finding {
            name: "overlap_range",
            figure: "8a",
            statement: "erosion: the overlap's relative error lies mainly in 1e-5 to 10",
            here: format!(
                "{} of the pairs (normal uniform: {})",
                percent(inside(lines)),
                percent(inside(normals))
            ),
            verdict: Verdict::of(inside(lines) > 0.99 && inside(normals) > 0.99),
        },
        Finding {
            name: "overlap_mean",
            figure: "8a",
            statement: "its logarithmic mean is about 1e-3",
            here: format!(
                "{} with the centre line or the normal uniform; {} with erosion of 1 % + 1 %, but then its 99.9th \
                 percentile is {} and the normal's 99th {}°",
                both(overlap.log_mean, overlap_n.log_mean),
                readable(overlap_fine.log_mean),
                readable(overlap_fine.p99_9),
                readable(normal_fine.p99)
            ),
            verdict: Verdict::of(about(&overlap) || about(&overlap_n)),
        },
        Finding {
            name: "overlap_log_normal",
            figure: "8a",
            statement: "it is distributed like a log-normal",
            here: format!(
                "skewness of its logarithm {}",
                both(overlap.log_skewness, overlap_n.log_skewness)
            ),
            verdict: Verdict::of(overlap.log_skewness.abs() < 1.0),
        },
        Finding {
            name: "intrinsic",
            figure: "8a",
            statement: "erosion's errors cannot be avoided by smaller tolerances",
            here: format!(
                "all of these are with a tolerance of {TIGHT:e} for GJK; the least of 1000 is {}",
                readable(overlap.p0_1)
            ),
            verdict: Verdict::of(overlap.p0_1 > 1e3 * TIGHT),
        },
    ]
}

fn normals_and_points_in_case_3(study: &Study) -> [Finding; 2] {
    let [lines, normals] =
        [CENTRE_LINE, NORMAL].map(|sampling| in_case_3(study, sampling, EROSION));
    let [_, normal, point] = lines.summaries();
    let [_, normal_n, point_n] = normals.summaries();
    let above = |values: &[f64], limit: f64| 1.0 - share(values, 0.0, limit);
    [
        Finding {
            name: "normal_below_3_deg",
            figure: "8b",
            statement: "erosion: the normal is off by less than 3°",
            here: format!(
                "99th percentile {}°, largest {}°, {} above",
                both(normal.p99, normal_n.p99),
                both(normal.max, normal_n.max),
                format_args!(
                    "{} and {}",
                    percent(above(&lines.normal, 3.0)),
                    percent(above(&normals.normal, 3.0))
                )
            ),
            verdict: as_a_bound(normal_n.max < 3.0, normal.p99 < 3.0),
        },
        Finding {
            name: "point_below_1_percent",
            figure: "8c",
            statement: "erosion: the contact point is off by less than 1 %",
            here: format!(
                "99th percentile {} %, largest {} %",
                both(100.0 * point.p99, 100.0 * point_n.p99),
                both(100.0 * point.max, 100.0 * point_n.max)
            ),
            verdict: as_a_bound(point.max < 0.01, above(&lines.point, 0.01) < 0.05),
        },
    ]
}

fn epa_in_case_3(study: &Study) -> [Finding; 3] {
    let epa = in_case_3(study, CENTRE_LINE, EPA);
    let [overlap_epa, normal_epa, point_epa] = epa.summaries();
    let [overlap_polished, normal_polished, _] =
        in_case_3(study, CENTRE_LINE, POLISHED_EPA).summaries();
    let within_epa = share(&epa.overlap, 1e-10, 1e-5);
    [
        Finding {
            name: "epa_range",
            figure: "8a",
            statement: "EPA: the overlap's relative error lies mainly in 1e-10 to 1e-5",
            here: format!(
                "at its tolerance of 1e-8, {} of the pairs; percentiles 1 and 99 are {} (with secants at the end, \
                 as this code has them unless told otherwise, the 99th is {})",
                percent(within_epa),
                both(overlap_epa.p1, overlap_epa.p99),
                readable(overlap_polished.p99)
            ),
            verdict: Verdict::of(within_epa > 0.9),
        },
        Finding {
            name: "epa_log_normal",
            figure: "8a",
            statement: "EPA: it is distributed like a log-normal, too",
            here: format!("skewness of its logarithm {}", readable(overlap_epa.log_skewness)),
            verdict: Verdict::of(overlap_epa.log_skewness.abs() < 1.0),
        },
        Finding {
            name: "epa_exact",
            figure: "8b, c",
            statement: "EPA: no errors of normal and contact point",
            here: format!(
                "not on the scale of the plot: at most {}° and {} m (with secants {}°)",
                readable(normal_epa.max),
                readable(point_epa.max),
                readable(normal_polished.max)
            ),
            verdict: as_a_bound(normal_epa.max < 1e-6, normal_epa.max < 0.03),
        },
    ]
}

fn table_1(rows: &[Times]) -> String {
    let mut table = "\
| bodies | method | tolerance | contact [ns] | warm | batched | non-contact [ns] | batched | the paper, contact | non-contact |
|---|---|---|---|---|---|---|---|---|---|
"
    .to_string();
    for row in rows {
        let paper = match (row.bodies, row.method) {
            (ELLIPSOIDS, CHECKED) => "6.99 | 0.13",
            (ELLIPSOIDS, EPA) => "12.50 | 0.13",
            (SPHERES, _) => "0.07 | 0.006",
            _ => "| ",
        };
        let tolerance = row.tolerance.map_or(String::new(), |t| format!("{t:e}"));
        let _ = writeln!(
            table,
            "| {} | {} | {tolerance} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {paper} |",
            row.bodies,
            row.method,
            row.contact_ns,
            row.contact_warm_ns,
            row.contact_batched_ns,
            row.non_contact_ns,
            row.non_contact_batched_ns,
        );
    }
    let newton = row(rows, "common normal", None).contact_ns;
    let part = |other: &Times| newton / other.contact_ns;
    let _ = writeln!(
        table,
        "\nThe common normal itself, which the paper takes as the truth, needs {:.2} of erosion's time and {:.3} of \
         EPA's (usual tolerances).\n",
        part(row(rows, ALONE, Some(ErodedGjk::default().tolerance))),
        part(row(rows, EPA, Some(Epa::default().tolerance)))
    );
    table
}

/// Row of a method with this tolerance.
fn row<'a>(rows: &'a [Times], method: &str, tolerance: Option<f64>) -> &'a Times {
    let wanted = |t: &&Times| t.method == method && t.tolerance == tolerance;
    rows.iter().find(wanted).expect("the study has all its methods")
}

fn times(rows: &[Times], reading: Reading) -> Vec<Finding> {
    let name = match reading {
        Reading::Checked => CHECKED,
        Reading::Alone => ALONE,
    };
    let erosion = |tolerance| row(rows, name, Some(tolerance));
    let epa = |tolerance| row(rows, EPA, Some(tolerance));
    let sphere = row(rows, "closed form", None);
    let saved = |fast: &Times, slow: &Times| 100.0 * (1.0 - fast.contact_ns / slow.contact_ns);
    let tolerances = [ErodedGjk::default().tolerance, Epa::default().tolerance];
    let usual = [erosion(tolerances[0]), epa(tolerances[1])];
    let saved_usually = saved(usual[0], usual[1]);
    let equal = [saved(erosion(1e-8), epa(1e-8)), saved(erosion(1e-4), epa(1e-4))];
    let over = |other: fn(&Times) -> f64| usual.map(|t| t.contact_ns / other(t));
    let over_apart = over(|t| t.non_contact_ns);
    let over_sphere = over(|_| 1.0).map(|ns| ns / sphere.contact_ns);
    // Times of other methods on another machine: the worse of two ratios counts.
    let like = |found: [f64; 2], paper: [f64; 2]| {
        let factors = found.iter().zip(paper).map(|(f, p)| (f / p).max(p / f));
        match factors.fold(1.0, f64::max) {
            ..2.0 => Verdict::Yes,
            ..3.0 => Verdict::Nearly,
            _ => Verdict::No,
        }
    };
    vec![
        Finding {
            name: "efficiency",
            figure: "T1",
            statement: "GJK-erosion is about 45 % more efficient than EPA (6.99 / 12.50)",
            here: format!(
                "it takes {:.0} % less with both tolerances at 1e-8, {:.0} % less with both at 1e-4, {saved_usually:.0} % less \
                 at the usual ones ({:e}, {:e})",
                equal[0], equal[1], tolerances[0], tolerances[1]
            ),
            verdict: like([1.0 - equal[0] / 100.0, 1.0 - equal[1] / 100.0], [0.56, 0.56]),
        },
        Finding {
            name: "apart_ratio",
            figure: "T1",
            statement: "a pair that is apart takes 1/54 (erosion) and 1/96 (EPA) of one that touches",
            here: format!("1/{:.0} and 1/{:.0}", over_apart[0], over_apart[1]),
            verdict: like(over_apart, [54.0, 96.0]),
        },
        Finding {
            name: "sphere_ratio",
            figure: "T1",
            statement: "touching ellipsoids take 100 (erosion) and 179 (EPA) times what spheres do",
            here: format!("{:.0} and {:.0} times", over_sphere[0], over_sphere[1]),
            verdict: like(over_sphere, [100.0, 179.0]),
        },
    ]
}
