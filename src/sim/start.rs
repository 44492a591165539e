//! Check of the overlaps at the start of a stage.

use super::{FirstLook, Simulation};
use crate::comm::{Comm, wire};
use crate::contact::{Pair, Posed, cut};
use crate::ids::{GlobalId, Slot};
use crate::math::Vec3;
use crate::measure::shortest_axis;
use crate::particles::Particles;
use crate::shape::Kind;
use crate::text::counted;

/// Deepest overlap with which a run may begin, over the shortest axis of the smaller body: the largest that DEM commonly
/// permits (the paper, section 2.1).
pub const DEEPEST_START: f64 = 0.05;

/// A pair at the start: its overlap over the shortest axis, the particle, the other body in the notation of files, and the
/// place [m].
type TooDeep = (f64, u64, i64, [f64; 3]);

/// Number of pairs that the error names.
const NAMED: usize = 5;

fn is_wall(body: i64) -> bool {
    GlobalId::from_file(body).wall_index().is_some()
}

/// Rejects bodies that overlap too deeply at the start, or that no method can resolve, and names the worst pairs. Contacts
/// that existed at the end of the previous stage are accepted.
pub(super) fn check_overlaps(sim: &mut Simulation, comm: &mut dyn Comm) -> Result<(), String> {
    let FirstLook { new, unresolved } = sim.look_first();
    let mut found: Vec<TooDeep> = Vec::new();
    let too_deep = new.into_iter().filter_map(|(pair, touch)| {
        let depth = touch.overlap / shortest_axis(&sim.particles, pair.a, pair.b);
        (depth > DEEPEST_START).then_some((depth, pair, touch.point))
    });
    let beyond_any = unresolved.iter().map(|&(pair, _)| (f64::INFINITY, pair, Vec3::zeros()));
    for (depth, pair, point) in too_deep.chain(beyond_any) {
        if pair.a.index() < sim.particles.owned {
            let (a, b) = (sim.particles.id[pair.a.index()], sim.particles.id[pair.b.index()]);
            let at = sim.particles.position[pair.a.index()] + point;
            found.push((depth, a.0, b.to_file(), at.into()));
        }
    }
    cut_by_triangles(sim, &mut found);
    let between_particles = found.iter().filter(|&&(_, _, b, _)| !is_wall(b)).count();
    let mut counts = [found.len(), between_particles].map(|count| count as i64);
    comm.sum(&mut counts);
    if counts[0] == 0 {
        return Ok(());
    }
    let worst = |found: &mut Vec<TooDeep>| {
        found.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        found.truncate(NAMED);
    };
    worst(&mut found);
    let gathered = comm.gather(wire::encode(&found));
    let mut bytes = Vec::new();
    if let Some(all) = gathered {
        found = all.iter().flat_map(|bytes| wire::decode::<Vec<_>>(bytes)).collect();
        worst(&mut found);
        bytes = overlap_message(&found, counts, &sim.particles).into_bytes();
    }
    comm.broadcast(&mut bytes);
    Err(String::from_utf8_lossy(&bytes).into_owned())
}

/// Smooth bodies that triangles cut from behind without a contact; their depth is that of a triangle in them.
fn cut_by_triangles(sim: &Simulation, found: &mut Vec<TooDeep>) {
    let particles = &sim.particles;
    let bodies = particles.bodies();
    for (k, wall) in particles.walls.iter().enumerate() {
        let Some(mesh) = &wall.mesh else { continue };
        let frame = wall.frame();
        let (shape, wall_at) = (&particles.library.shapes[mesh.shape.index()], wall.point);
        let b = Posed::new(shape, &frame);
        for slot in (0..particles.owned).filter(|&slot| !particles.is_held(slot)) {
            let a = Slot(slot as u32);
            let kind = bodies.shape_of(a).kind();
            // A support function ignores the dents of a union.
            if matches!(kind, Kind::Sphere | Kind::Union) || kind.extended()[0] > 0 {
                continue;
            }
            let turned = bodies.frame(a);
            let a = Posed {
                scale: particles.scale_of(slot),
                ..Posed::new(bodies.shape_of(a), &turned)
            };
            let places =
                particles.cell.places_within(&particles.position[slot], a.bounding_radius());
            let cuts = places.iter().filter_map(|place| {
                let least = 2.0 * DEEPEST_START;
                cut(&a, &b, &(wall_at - place), least).map(|cut| (cut, *place))
            });
            let deepest = cuts.max_by(|(one, _), (other, _)| one.0.total_cmp(&other.0));
            let Some(((part, face), place)) = deepest else { continue };
            let id = particles.id[slot].0;
            let is_known = |(_, of, by, _): &TooDeep| {
                *of == id && GlobalId::from_file(*by).wall_index() == Some(k)
            };
            // Contacts that existed at the end of the previous stage are accepted.
            let touches =
                |pair: Pair| pair.a.index() == slot && particles.wall_of(pair.b) == Some(k);
            if !found.iter().any(is_known)
                && !sim.contacts.on_walls(particles).any(|(pair, _)| touches(pair))
            {
                let face = GlobalId::facet(k, face as usize).to_file();
                found.push((0.5 * part, id, face, place.into()));
            }
        }
    }
}

/// Error message for the `worst` of `all` pairs, `between_particles` of which are of two particles.
fn overlap_message(
    worst: &[TooDeep],
    [all, between_particles]: [i64; 2],
    particles: &Particles,
) -> String {
    use std::fmt::Write;
    let mut text = format!(
        "{} overlap by more than {} % of the shortest axis at the start:",
        counted(all.unsigned_abs(), "pair"),
        100.0 * DEEPEST_START
    );
    for (depth, a, b, at) in worst {
        let partner = particles.body_name(GlobalId::from_file(*b));
        let how_deep = if depth.is_finite() {
            format!("{:.1} %", 100.0 * depth)
        } else {
            "too deep for any contact method,".to_owned()
        };
        let _ = write!(
            text,
            "\n  particle {a} and {partner}: {how_deep} at ({:.4e}, {:.4e}, {:.4e}) m",
            at[0], at[1], at[2]
        );
    }
    if all > worst.len() as i64 {
        text.push_str("\n  ...");
    }
    text.push_str(if worst[0].0 >= 1.0 && is_wall(worst[0].2) {
        "\nCheck whether that particle is behind the wall: the normal of a wall points towards the particles"
    } else if between_particles == 0 {
        "\nMove the walls or the particles apart. A lattice fills places at walls, too; rain and inlets leave them \
         out"
    } else {
        "\nMove them apart, or use a larger spacing"
    });
    text
}
