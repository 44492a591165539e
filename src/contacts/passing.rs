//! Transfer of state between contacts that move from one facet or piece to another.

use super::pieces;
use super::surfaces::OnMesh;
use crate::contact::{Geometry, Pair, Previous};
use crate::ids::GlobalId;
use crate::law::Separated;
use crate::particles::Particles;

/// Lets new contacts on meshes continue ended ones on adjacent facets, and contacts of pieces continue those of other
/// pieces of the same bodies. If there are several, the one with the nearest normal is continued.
pub(super) fn pass_on(
    (now, geometry): (&[Pair], &[Geometry]),
    (before, geometry_before): (&[Pair], &[Geometry]),
    from: &mut [Previous],
    separated: &mut Vec<Separated>,
    particles: &Particles,
) {
    for row in 0..from.len() {
        if from[row] != Previous::NONE || separated.is_empty() {
            continue;
        }
        let on = OnMesh::of(now[row], particles);
        let nearness = |ended: &Separated| {
            let (pair, last) = (before[ended.place], &geometry_before[ended.place].normal);
            let new = (now[row], &geometry[row].normal);
            on.as_ref()
                .and_then(|on| on.nearness(new, (pair, last), particles))
                .or_else(|| pieces::likeness(new, (pair, last), particles))
        };
        let mut best: Option<(f64, GlobalId, usize)> = None;
        for (k, ended) in separated.iter().enumerate() {
            let Some(nearness) = nearness(ended) else { continue };
            let id = particles.id[before[ended.place].b.index()];
            let is_better = best.is_none_or(|(nearest, of, _)| {
                nearness > nearest || nearness == nearest && id < of
            });
            if is_better {
                best = Some((nearness, id, k));
            }
        }
        if let Some((_, _, k)) = best {
            from[row] = Previous::at(separated.remove(k).place);
        }
    }
}
