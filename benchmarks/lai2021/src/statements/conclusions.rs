//! Section 4: conclusions, each with the worst verdict of the findings that it rests on.

use crate::findings::{Kind, Reading, Row, Verdict};

/// A sentence of section 4.
struct Conclusion {
    name: &'static str,
    statement: &'static str,
    /// Names of the findings on which it rests.
    rests_on: &'static [&'static str],
}

const CONCLUSIONS: [Conclusion; 11] = [
    Conclusion {
        name: "overestimates",
        statement: "radial erosion overestimates overlaps",
        rests_on: &["overestimated"],
    },
    Conclusion {
        name: "small_overlaps",
        statement: "by 100 % or more of small overlaps, and by little of large ones",
        rests_on: &["beyond_100_percent", "relative_error"],
    },
    Conclusion {
        name: "normal_and_point",
        statement: "its effects on contact normal and contact point are negligibly small",
        rests_on: &["normal_below_3_deg", "point_below_1_percent"],
    },
    Conclusion {
        name: "mechanism",
        statement: "the overestimated overlaps push particles away and dismiss weak contacts",
        rests_on: &["pushing_away"],
    },
    Conclusion {
        name: "fewer_contacts",
        statement: "there are fewer contacts, and fewer weak ones",
        rests_on: &["z_shifted", "weak_dismissed"],
    },
    Conclusion {
        name: "weak_carry_little",
        statement: "weak contacts contribute little to the shear resistance (taken from others' work, not measured here)",
        rests_on: &[],
    },
    Conclusion {
        name: "fabric",
        statement: "the effect on the fabric of packings is negligible",
        rests_on: &["fabric_packing", "fabric_peak"],
    },
    Conclusion {
        name: "stress_strain",
        statement: "the effect on the stress-strain behaviour is negligible",
        rests_on: &["same_peak", "same_plateau", "same_curve", "same_volume"],
    },
    Conclusion {
        name: "large_ratio",
        statement: "too large an erosion ratio overestimates overlaps significantly",
        rests_on: &["ratio_too_large"],
    },
    Conclusion {
        name: "efficient",
        statement: "GJK-erosion is about 45 % more efficient than EPA",
        rests_on: &["efficiency"],
    },
    Conclusion {
        name: "more_efficient",
        statement: "optimisation by gradients makes it more efficient still",
        rests_on: &["gradients"],
    },
];

/// Rows of section 4, from those of the other sections.
pub fn rows(findings: &[Row]) -> Vec<Row> {
    let all = Reading::ALL.into_iter();
    all.flat_map(|reading| {
        CONCLUSIONS.iter().map(move |conclusion| {
            let find = |name: &&str| {
                findings.iter().find(|row| row.name == *name && row.reading == reading)
            };
            let found: Vec<&Row> = conclusion.rests_on.iter().filter_map(find).collect();
            // One finding that does not reproduce is enough; otherwise all must be known.
            let is_whole = found.len() == conclusion.rests_on.len()
                && found.iter().all(|row| row.verdict != Verdict::Untold);
            let here: Vec<String> = found
                .iter()
                .map(|row| format!("{} ({}): {}", row.statement, row.figure, row.verdict.words()))
                .collect();
            let verdict = Verdict::worst(found.iter().map(|row| row.verdict));
            Row {
                part: "4 Conclusions".into(),
                name: conclusion.name.into(),
                kind: Kind::Statement,
                figure: "4".into(),
                statement: conclusion.statement.into(),
                reading,
                here: if here.is_empty() { "–".into() } else { here.join("; ") },
                verdict: if is_whole || verdict == Verdict::No { verdict } else { Verdict::Untold },
            }
        })
    })
    .collect()
}
