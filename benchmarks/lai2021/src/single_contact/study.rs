//! Cases of section 2 resolved by every method, and the errors of eqs. 1 to 3.

use super::statistics::{Summary, per_decade};
use super::{Plan, StudyError};
use crate::cases::{self, Meeting, OFFSET, Sampling, steps};
use crate::findings::Reading;
use dem_mpi::contact::{Epa, ErodedGjk, Method, Touch};
use dem_mpi::math::Vec3;
use dem_mpi::pairs::{Pairs, resolve, time};
use serde::Serialize;

/// Erosion ratio of the paper.
pub const RATIO: f64 = 0.05;
/// Relative duality gap of GJK for the measurement of errors: the remaining error is that of erosion.
pub const TIGHT: f64 = 1e-14;

/// Erosion that begins at `ratio`, with GJK run to rounding.
pub const fn erosion(ratio: f64) -> Method {
    Method::GjkErosion(tight(ratio, Reading::Alone))
}

const fn tight(ratio: f64, reading: Reading) -> ErodedGjk {
    let spurious = matches!(reading, Reading::Alone);
    ErodedGjk { ratio, increment: 0.01, tolerance: TIGHT, spurious }
}

/// Errors of a method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// True overlap [m].
    pub overlap_m: f64,
    /// Overlap found [m].
    pub overlap_found_m: f64,
    /// Relative error of the overlap, eq. 1; infinite at touch.
    pub relative_overlap_error: f64,
    /// Angle between the normals, eq. 2 [°].
    pub normal_error_deg: f64,
    /// Distance of the contact points, eq. 3 [m].
    pub point_error_m: f64,
}

impl Errors {
    /// Errors of a touch relative to the exact one.
    pub fn of(found: &Touch, exact: &Touch) -> Self {
        // By an arc tangent: an arc cosine has an error of 1.5e-8 rad.
        let sine = found.normal.cross(&exact.normal).norm();
        Self {
            overlap_m: exact.overlap,
            overlap_found_m: found.overlap,
            relative_overlap_error: (found.overlap - exact.overlap) / exact.overlap,
            normal_error_deg: sine.atan2(found.normal.dot(&exact.normal)).to_degrees(),
            point_error_m: (found.point - exact.point).norm(),
        }
    }
}

/// Touches of all pairs; negative overlaps if they are apart.
fn touches(pairs: &Pairs, method: &Method) -> Result<Vec<Touch>, StudyError> {
    let answers = resolve(pairs, method).into_iter().enumerate();
    answers
        .map(|(k, answer)| {
            answer.touch.map_err(|why| StudyError::Unresolved {
                method: method.name(),
                pair: pairs.name(k).to_string(),
                why,
            })
        })
        .collect()
}

/// Errors of a method on every pair.
///
/// # Errors
/// See [`StudyError::Unresolved`].
pub fn errors(pairs: &Pairs, method: &Method) -> Result<Vec<Errors>, StudyError> {
    let exact = touches(pairs, &Method::CommonNormal)?;
    let found = touches(pairs, method)?;
    Ok(found.iter().zip(&exact).map(|(found, exact)| Errors::of(found, exact)).collect())
}

/// A row of fig. 5.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct InCase1 {
    /// First erosion ratio.
    pub erosion_ratio: f64,
    /// True overlap [m]; short axis 1 m.
    pub overlap_m: f64,
    /// Overlap found [m].
    pub overlap_found_m: f64,
    /// See [`Errors`].
    pub relative_overlap_error: f64,
    /// See [`Errors`].
    pub normal_error_deg: f64,
    /// See [`Errors`].
    pub point_error_m: f64,
}

/// Case I for one erosion ratio, with the requested overlaps, which the pairs have up to rounding [m].
///
/// # Errors
/// See [`StudyError::Unresolved`].
pub fn case_1(ratio: f64, overlaps: &[f64]) -> Result<Vec<InCase1>, StudyError> {
    let errors = errors(&cases::case_1(OFFSET, overlaps), &erosion(ratio))?;
    let row = |(&overlap, e): (&f64, &Errors)| InCase1 {
        erosion_ratio: ratio,
        overlap_m: overlap,
        overlap_found_m: e.overlap_found_m,
        relative_overlap_error: (e.overlap_found_m - overlap) / overlap,
        normal_error_deg: e.normal_error_deg,
        point_error_m: e.point_error_m,
    };
    Ok(overlaps.iter().zip(&errors).map(row).collect())
}

/// A row of fig. 6: Case I with the centre of B at other places along y.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct AtOffset {
    /// Centre of B along y [m].
    pub y_m: f64,
    /// True overlap [m].
    pub overlap_m: f64,
    /// Angle between the normals [°].
    pub normal_error_deg: f64,
}

/// Error of the normal at an offset, for each overlap [m].
///
/// # Errors
/// See [`StudyError::Unresolved`].
pub fn at_offset(y: f64, overlaps: &[f64]) -> Result<Vec<AtOffset>, StudyError> {
    let errors = errors(&cases::case_1(y, overlaps), &erosion(RATIO))?;
    let row = |(&overlap_m, e): (&f64, &Errors)| AtOffset {
        y_m: y,
        overlap_m,
        normal_error_deg: e.normal_error_deg,
    };
    Ok(overlaps.iter().zip(&errors).map(row).collect())
}

/// A row of fig. 7.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct InCase2 {
    /// Length of the long axis [m]; short axes 1 m.
    pub long_axis_m: f64,
    /// Angle between the long axes [°].
    pub angle_deg: f64,
    /// See [`Errors`].
    pub relative_overlap_error: f64,
    /// See [`Errors`].
    pub normal_error_deg: f64,
    /// See [`Errors`].
    pub point_error_m: f64,
}

/// Case II on a grid of long axes [m] and angles [°], angles fastest.
///
/// # Errors
/// See [`StudyError::Unresolved`].
pub fn case_2(ratio: f64, axes: &[f64], angles: &[f64]) -> Result<Vec<InCase2>, StudyError> {
    let errors = errors(&cases::case_2(axes, angles), &erosion(ratio))?;
    let grid = axes.iter().flat_map(|&axis| angles.iter().map(move |&angle| (axis, angle)));
    let row = |((long_axis_m, angle_deg), e): ((f64, f64), &Errors)| InCase2 {
        long_axis_m,
        angle_deg,
        relative_overlap_error: e.relative_overlap_error,
        normal_error_deg: e.normal_error_deg,
        point_error_m: e.point_error_m,
    };
    Ok(grid.zip(&errors).map(row).collect())
}

/// Errors of random pairs with one method.
pub struct InCase3 {
    /// Sampling of the pairs.
    pub sampling: &'static str,
    /// Method of contact resolution.
    pub method: &'static str,
    /// Relative errors of the overlap, without sign.
    pub overlap: Vec<f64>,
    /// Angles between the normals [°].
    pub normal: Vec<f64>,
    /// Distances of the contact points [m].
    pub point: Vec<f64>,
}

impl InCase3 {
    /// Errors of these pairs with `method`.
    ///
    /// # Errors
    /// See [`StudyError::Unresolved`].
    pub fn new(
        sampling: &'static str,
        name: &'static str,
        pairs: &Pairs,
        method: &Method,
    ) -> Result<Self, StudyError> {
        let errors = errors(pairs, method)?;
        Ok(Self {
            sampling,
            method: name,
            overlap: errors.iter().map(|e| e.relative_overlap_error.abs()).collect(),
            normal: errors.iter().map(|e| e.normal_error_deg).collect(),
            point: errors.iter().map(|e| e.point_error_m).collect(),
        })
    }

    /// The three errors with their names.
    pub fn quantities(&self) -> [(&'static str, &[f64]); 3] {
        [
            ("overlap_relative", &self.overlap),
            ("normal_deg", &self.normal),
            ("point_m", &self.point),
        ]
    }

    /// Statistics of the three errors.
    pub fn summaries(&self) -> [Summary; 3] {
        self.quantities()
            .map(|(quantity, errors)| Summary::of(self.sampling, self.method, quantity, errors))
    }
}

/// A row of fig. 8: a bin of a tenth of a decade.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Density {
    /// Sampling of the pairs.
    pub sampling: &'static str,
    /// Method of contact resolution.
    pub method: &'static str,
    /// Quantity with the error.
    pub quantity: &'static str,
    /// Error at the centre of the bin.
    pub error: f64,
    /// Share of the pairs per decade of the error.
    pub share_per_decade: f64,
}

/// A row of table 1.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Times {
    /// Kind of the bodies.
    pub bodies: &'static str,
    /// Method of contact resolution.
    pub method: &'static str,
    /// Tolerance of the method; empty if it needs none.
    pub tolerance: Option<f64>,
    /// Time per pair with an overlap of 0 to 0.05 m, one by one without a guess [ns].
    pub contact_ns: f64,
    /// Time per such pair from a normal that is off by 1e-4 [ns].
    pub contact_warm_ns: f64,
    /// Time per such pair in a batch [ns].
    pub contact_batched_ns: f64,
    /// Time per pair with a clearance of 0 to 1 m, one by one without a guess [ns].
    pub non_contact_ns: f64,
    /// Time per such pair in a batch [ns].
    pub non_contact_batched_ns: f64,
}

/// Results of section 2.
pub struct Study {
    /// Fig. 5, for each first erosion ratio.
    pub case_1: Vec<InCase1>,
    /// Overlap at which the overlap found is twice the true one [m].
    pub twice: f64,
    /// Clearance below which pairs of Case I are found touching [m], for each [`Reading`] of erosion.
    pub spurious: [f64; 2],
    /// Fig. 6 by offset.
    pub offsets: Vec<AtOffset>,
    /// Fig. 6: Case I with B further towards A.
    pub deeper: Vec<AtOffset>,
    /// Fig. 7.
    pub case_2: Vec<InCase2>,
    /// Fig. 8.
    pub case_3: Vec<InCase3>,
    /// Table 1.
    pub times: Vec<Times>,
}

impl Study {
    /// Erosion ratios of fig. 5: that of the paper, 2 % and 1 %.
    pub const RATIOS: [f64; 3] = [RATIO, 0.02, 0.01];

    /// Computes all results.
    ///
    /// # Errors
    /// See [`StudyError`].
    pub fn new(plan: &Plan) -> Result<Self, StudyError> {
        let overlaps = steps(0.0, 0.05, 50);
        let mut in_case_1 = Vec::new();
        for ratio in Self::RATIOS {
            in_case_1.extend(case_1(ratio, &overlaps)?);
        }
        let mut offsets = Vec::new();
        for y in steps(0.05, 0.75, 70) {
            offsets.extend(at_offset(y, &steps(0.0, 0.05, 10))?);
        }
        Ok(Self {
            case_1: in_case_1,
            twice: root(1e-4, 1e-2, |overlap| {
                Ok(case_1(RATIO, &[overlap])?[0].relative_overlap_error - 1.0)
            })?,
            spurious: [spurious(Reading::ALL[0])?, spurious(Reading::ALL[1])?],
            offsets,
            deeper: at_offset(OFFSET, &steps(0.0, 0.3, 150))?,
            case_2: case_2(RATIO, &steps(1.0, 4.0, 24), &steps(0.0, 180.0, 36))?,
            case_3: in_case_3(plan)?,
            times: times(plan),
        })
    }

    /// Rows of fig. 8.
    pub fn distributions(&self) -> Vec<Density> {
        let mut rows = Vec::new();
        for case in &self.case_3 {
            for (quantity, errors) in case.quantities() {
                rows.extend(per_decade(errors).into_iter().map(|(error, share_per_decade)| {
                    let (sampling, method) = (case.sampling, case.method);
                    Density { sampling, method, quantity, error, share_per_decade }
                }));
            }
        }
        rows
    }

    /// Statistics of the distributions of fig. 8.
    pub fn summaries(&self) -> Vec<Summary> {
        self.case_3.iter().flat_map(InCase3::summaries).collect()
    }
}

/// Clearance below which erosion finds pairs of Case I touching [m].
fn spurious(reading: Reading) -> Result<f64, StudyError> {
    let method = Method::GjkErosion(tight(RATIO, reading));
    root(0.0, 1e-2, |clearance| {
        let answers = resolve(&cases::case_1(OFFSET, &[-clearance]), &method);
        Ok(if answers[0].touching { 1.0 } else { -1.0 })
    })
}

/// Root of a function that is positive at `low` and negative at `high`.
fn root(
    mut low: f64,
    mut high: f64,
    value: impl Fn(f64) -> Result<f64, StudyError>,
) -> Result<f64, StudyError> {
    const HALVINGS: u32 = 50;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if value(middle)? > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(0.5 * (low + high))
}

/// Names in fig. 8.
pub const CENTRE_LINE: &str = "centre line uniform";
/// See [`CENTRE_LINE`].
pub const NORMAL: &str = "normal uniform";
/// See [`CENTRE_LINE`].
pub const EROSION: &str = "erosion 5 %";
/// See [`CENTRE_LINE`].
pub const FINE_EROSION: &str = "erosion 1 %";
/// See [`CENTRE_LINE`].
pub const EPA: &str = "EPA";
/// See [`CENTRE_LINE`].
pub const POLISHED_EPA: &str = "EPA with secants";

/// EPA as in the paper, which ends with its polytope.
const fn plain_epa(tolerance: f64) -> Method {
    Method::Epa(Epa { tolerance, polish: false })
}

fn in_case_3(plan: &Plan) -> Result<Vec<InCase3>, StudyError> {
    let draw = |sampling| cases::case_3(Meeting::Contact, sampling, plan.count as usize, plan.seed);
    let (lines, normals) = (draw(Sampling::CentreLine), draw(Sampling::Normal));
    let Epa { tolerance, .. } = Epa::default();
    Ok(vec![
        InCase3::new(CENTRE_LINE, EROSION, &lines, &erosion(RATIO))?,
        InCase3::new(CENTRE_LINE, EPA, &lines, &plain_epa(tolerance))?,
        InCase3::new(CENTRE_LINE, POLISHED_EPA, &lines, &Method::Epa(Epa::new(tolerance)))?,
        InCase3::new(CENTRE_LINE, FINE_EROSION, &lines, &erosion(0.01))?,
        InCase3::new(NORMAL, EROSION, &normals, &erosion(RATIO))?,
    ])
}

/// Rows of table 1, of the paper and of this code.
fn times(plan: &Plan) -> Vec<Times> {
    let draw =
        |meeting| cases::case_3(meeting, Sampling::CentreLine, plan.count as usize, plan.seed);
    let balls = |meeting| cases::spheres(meeting, plan.count as usize, plan.seed);
    let ellipsoids = (draw(Meeting::Contact), draw(Meeting::NonContact));
    let spheres = (balls(Meeting::Contact), balls(Meeting::NonContact));
    let paper = ErodedGjk { ratio: RATIO, ..ErodedGjk::default() };
    let erosion = |tolerance| Method::GjkErosion(ErodedGjk { tolerance, ..paper });
    let checked = |tolerance| Method::GjkErosion(ErodedGjk { tolerance, spurious: false, ..paper });
    let measured = |bodies, (contact, apart): &(Pairs, Pairs), method: Method| {
        let of =
            |pairs: &Pairs| time(pairs, &resolve(pairs, &method), &method, plan.repeats as usize);
        let (touching, apart) = (of(contact), of(apart));
        let (name, tolerance) = match method {
            _ if bodies == SPHERES => ("closed form", None),
            Method::GjkErosion(erosion) => {
                (if erosion.spurious { ALONE } else { CHECKED }, Some(erosion.tolerance))
            }
            Method::Epa(epa) => (if epa.polish { POLISHED_EPA } else { EPA }, Some(epa.tolerance)),
            Method::Auto | Method::CommonNormal => ("common normal", None),
        };
        Times {
            bodies,
            method: name,
            tolerance,
            contact_ns: touching.cold,
            contact_warm_ns: touching.warm,
            contact_batched_ns: touching.batched,
            non_contact_ns: apart.cold,
            non_contact_batched_ns: apart.batched,
        }
    };
    vec![
        measured(ELLIPSOIDS, &ellipsoids, erosion(1e-4)),
        measured(ELLIPSOIDS, &ellipsoids, erosion(paper.tolerance)),
        measured(ELLIPSOIDS, &ellipsoids, erosion(1e-8)),
        measured(ELLIPSOIDS, &ellipsoids, checked(1e-4)),
        measured(ELLIPSOIDS, &ellipsoids, checked(paper.tolerance)),
        measured(ELLIPSOIDS, &ellipsoids, checked(1e-8)),
        measured(ELLIPSOIDS, &ellipsoids, plain_epa(1e-4)),
        measured(ELLIPSOIDS, &ellipsoids, plain_epa(Epa::default().tolerance)),
        measured(ELLIPSOIDS, &ellipsoids, Method::Epa(Epa::new(1e-4))),
        measured(ELLIPSOIDS, &ellipsoids, Method::Epa(Epa::default())),
        measured(ELLIPSOIDS, &ellipsoids, Method::CommonNormal),
        measured(SPHERES, &spheres, Method::Auto),
    ]
}

/// Overlap in the sketch of fig. 6 [m]: the largest of Case I.
pub const SKETCHED_OVERLAP: f64 = 0.05;

/// Name in table 1 of erosion with [`Reading::Alone`].
pub const ALONE: &str = "GJK-erosion";
/// Name in table 1 of erosion with [`Reading::Checked`].
pub const CHECKED: &str = "GJK + GJK-erosion";

/// Bodies in table 1.
pub const ELLIPSOIDS: &str = "ellipsoids";
/// See [`ELLIPSOIDS`].
pub const SPHERES: &str = "spheres";

/// The pair sketched in fig. 6: position of B relative to A [m], true normal, and normal of the cores.
///
/// # Errors
/// See [`StudyError::Unresolved`].
pub fn normals(y: f64, overlap: f64) -> Result<(Vec3, Vec3, Vec3), StudyError> {
    let pairs = cases::case_1(y, &[overlap]);
    let (_, _, r) = pairs.posed(0);
    let exact = touches(&pairs, &Method::CommonNormal)?[0].normal;
    Ok((r, exact, touches(&pairs, &erosion(RATIO))?[0].normal))
}
