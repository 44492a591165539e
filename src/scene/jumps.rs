//! Changes of contact forces where a stage starts from a snapshot made with other contact constants.

use super::input;
use super::laws;
use super::matter::Materials;
use super::mistakes::{Location, Mistakes};
use super::reader::Given;
use crate::ids::{MaterialId, ShapeId};
use crate::law::{Additions, Body, Choice, ForceLaw, hertz};
use crate::population::Library;
use std::collections::BTreeSet;

/// Largest relative difference of equal constants.
const SAME: f64 = 1e-9;
/// Number of pairs of materials that a warning names.
const NAMED: usize = 3;

/// Force constants of contacts of two materials.
struct Forces {
    /// Normal force per overlap [N/m], or Young's modulus of contacts [Pa].
    normal: f64,
    /// Tangential stiffness [N/m], or shear modulus of contacts [Pa]; 0 without friction.
    tangential: f64,
    /// Damping ratios, normal and tangential [-].
    dashpots: [f64; 2],
    /// Surface energy [J/m²].
    sticks: f64,
}

impl Forces {
    fn of(law: &Choice, a: MaterialId, b: MaterialId) -> Self {
        match law {
            Choice::Linear(law) => {
                let c = law.interactions.of(a, b);
                let [tangential, dashpot] = if c.is_frictional() {
                    [c.tangential_stiffness, c.tangential_damping_ratio]
                } else {
                    [0.0; 2]
                };
                let dashpots = [c.normal_damping_ratio, dashpot];
                Self { normal: c.normal_stiffness, tangential, dashpots, sticks: 0.0 }
            }
            Choice::Hertz(law) => Self::of_hertz(law, a, b),
            Choice::Jkr(law) => {
                let sticks = law.adhesion.of(a, b).surface_energy;
                Self { sticks, ..Self::of_hertz(&law.elastic, a, b) }
            }
            Choice::With(law, Additions { adhesion, .. }) => {
                let sticks = adhesion.as_ref().map_or(0.0, |all| all.of(a, b).surface_energy);
                Self { sticks, ..Self::of(law, a, b) }
            }
        }
    }

    fn of_hertz(law: &hertz::Settings, a: MaterialId, b: MaterialId) -> Self {
        let c = law.interactions.of(a, b);
        let frictional = |x: f64| if c.friction > 0.0 { x } else { 0.0 };
        let dashpots = [c.damping_ratio, frictional(c.damping_ratio)];
        let tangential = frictional(c.shear_modulus);
        Self { normal: c.modulus, tangential, dashpots, sticks: 0.0 }
    }

    /// Differences from the previous constants, where contacts press `pressed` times as hard.
    fn changes(&self, before: &Self, pressed: f64) -> Vec<String> {
        let times = |what: &str, how: &str, now: f64, before: f64| {
            let ratio = now / before;
            let is_same = now == before || (ratio - 1.0).abs() < SAME;
            // Friction that is switched on or off is an intended change.
            let is_both = now > 0.0 && before > 0.0;
            (!is_same && is_both).then(|| format!("{what} {} as {how} as before", as_often(ratio)))
        };
        let dashpots = [0, 1].map(|k| (self.dashpots[k], before.dashpots[k]));
        let [normal, tangential] = dashpots;
        let all = [
            times("contacts are", "stiff", pressed, 1.0),
            times("tangential springs are", "stiff", self.tangential, before.tangential),
            times("normal dashpots are", "strong", normal.0, normal.1),
            times("tangential dashpots are", "strong", tangential.0, tangential.1)
                .filter(|_| tangential != normal),
            times("surface energy is", "large", self.sticks, before.sticks),
            (self.sticks > 0.0 && before.sticks == 0.0).then(|| "contacts stick".to_owned()),
            (self.sticks == 0.0 && before.sticks > 0.0)
                .then(|| "contacts no longer stick".to_owned()),
        ];
        all.into_iter().flatten().collect()
    }
}

/// A ratio in text form.
fn as_often(ratio: f64) -> String {
    let digits = format!("{ratio:.3}");
    let short = digits.trim_end_matches('0').trim_end_matches('.');
    if (0.01..1e4).contains(&ratio) {
        format!("{short} times")
    } else {
        format!("{ratio:.2e} times")
    }
}

/// Approximate force ratio of contacts between two laws whose forces depend differently on the overlap. It holds at the
/// overlap for which the step of the stiffening law is chosen.
fn pressed_by_laws(
    laws: &[Box<dyn ForceLaw>; 2],
    library: &Library,
    (a, b): (MaterialId, MaterialId),
) -> f64 {
    let of_material = |(shape, _): &(ShapeId, f64)| library.materials[shape.index()] == a;
    let Some((shape, scale)) = library.extremes().find(of_material) else { return f64::NAN };
    let body = Body::of(library, shape, scale);
    let [now, before] = laws.each_ref().map(|law| {
        // For Hertz the force is two thirds of the stiffness times the overlap.
        let share = if law.about().hardest_up_to().is_some() { 2.0 / 3.0 } else { 1.0 };
        share * law.about().hardest(&body, b, 0.5 * body.mass).stiffness
    });
    now / before
}

/// A warning about contacts of a snapshot that will press, rub or stick differently. `before` is its scene as text; a text
/// that is no scene of this program gives no warning.
pub(super) fn jumps(
    before: &str,
    materials: &Materials,
    law: &Choice,
    library: &Library,
) -> Option<String> {
    let mistakes = Mistakes::default();
    let root = input::read(before, &Location::Line, &mistakes)?;
    let root = Given::root(&root, &mistakes).section()?;
    let kind = laws::kind(&root);
    let (materials_before, law_before) = laws::materials(&root, kind);
    let law_before = law_before?;
    let are_alike = law.forces().linear().is_some() == law_before.forces().linear().is_some();
    let find = |name: &str| materials_before.names().position(|other| other == name);
    let known: Vec<(&str, MaterialId, MaterialId)> = (0..)
        .zip(materials.names())
        .filter_map(|(k, name)| Some((name, MaterialId(k), MaterialId(find(name)? as u16))))
        .collect();
    let laws = (!are_alike).then(|| [law, &law_before].map(|law| law.law(library)));
    let grains: BTreeSet<&MaterialId> =
        library.materials[..library.particle_shapes].iter().collect();
    let (mut changed, mut more) = (Vec::new(), 0);
    for (k, &(name, a, a_before)) in known.iter().enumerate() {
        for &(other, b, b_before) in &known[k..] {
            if !grains.contains(&a) && !grains.contains(&b) {
                continue;
            }
            let (now, then) = (Forces::of(law, a, b), Forces::of(&law_before, a_before, b_before));
            let changes = if let Some(laws) = &laws {
                let pair = if grains.contains(&a) { (a, b) } else { (b, a) };
                let pressed = pressed_by_laws(laws, library, pair);
                vec![format!(
                    "another law: contacts are some {} as stiff as before",
                    as_often(pressed)
                )]
            } else {
                now.changes(&then, now.normal / then.normal)
            };
            if changes.is_empty() {
                continue;
            }
            if changed.len() < NAMED {
                changed.push(format!("\"{name}\" and \"{other}\": {}", changes.join(", ")));
            } else {
                more += 1;
            }
        }
    }
    if more > 0 {
        changed.push(format!("and {more} more pairs of materials"));
    }
    (!changed.is_empty()).then(|| {
        format!(
            "contact laws differ from those of the snapshot, so forces jump at the start. {}. End the stage before \
             with these constants, or let it come to rest first",
            changed.join("; ")
        )
    })
}
