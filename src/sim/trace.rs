//! Trace of one particle step by step, to find faults: its state and its contacts as lines of
//! `name=value`. It does not depend on the number of ranks.

use super::Simulation;
use crate::comm::{Comm, everywhere, wire};
use crate::contact::{Pair, StateColumn};
use crate::contacts::Loaded;
use crate::ids::GlobalId;
use crate::law::{torque_on_a, torque_on_b};
use crate::math::Vec3;
use std::fmt::Write;

impl Simulation {
    /// State of a particle at this step in one line, then its contacts, a line each, by rising id of
    /// the partner. Returned on rank 0, empty elsewhere. All in SI units. `force` and `torque` of a
    /// contact act on the particle. `normal` points from the lower id to the higher, `point` is given
    /// from the particle of the lower id. Every number is written so that it reads back to the same
    /// bits. Collective.
    pub fn trace(&self, id: GlobalId, comm: &mut dyn Comm) -> String {
        let mine = self.trace_here(id).unwrap_or_default();
        let all = comm.gather(wire::encode(&mine)).unwrap_or_default();
        let text: String = all.iter().map(|bytes| wire::decode::<String>(bytes)).collect();
        if text.is_empty() && comm.is_root() {
            return format!("trace step={} particle={id} not there\n", self.step);
        }
        text
    }

    fn trace_here(&self, id: GlobalId) -> Option<String> {
        let particles = &self.particles;
        let slot = particles.id[..particles.owned].iter().position(|&other| other == id)?;
        let step = self.step;
        let mut text = format!("trace step={step} particle={id} time={:e}", self.time());
        let mut vector = |name, value: Vec3| {
            let _ = write!(text, " {name}={}", commas(value.as_slice()));
        };
        vector("position", particles.position[slot]);
        vector("velocity", particles.velocity[slot]);
        vector("force", particles.force[slot].vector);
        if particles.needs.scale {
            let _ = write!(text, " scale={:e}", particles.scale[slot]);
        }
        if let Some(orientation) = &particles.orientation {
            let q = orientation.quaternion[slot];
            let _ = write!(text, " quaternion={}", commas(&[q.w, q.i, q.j, q.k]));
        }
        if let Some(spin) = &particles.spin {
            let mut vector = |name, value: Vec3| {
                let _ = write!(text, " {name}={}", commas(value.as_slice()));
            };
            vector("angular_momentum", particles.angular_momentum(slot));
            vector("torque", spin.torque[slot].vector);
        }
        let mut lines = Vec::new();
        for contact in self.contacts.loaded(&*self.law, particles) {
            let Loaded { pair, geometry, state, normal_force, force, point, .. } = contact;
            let whole = Pair { a: particles.body_of(pair.a), b: particles.body_of(pair.b) };
            let is_a = whole.a.index() == slot;
            if !is_a && whole.b.index() != slot {
                continue;
            }
            let [id_of_a, id_of_b] = [whole.a, whole.b].map(|slot| particles.id[slot.index()]);
            let partner = if is_a { id_of_b } else { id_of_a };
            let r = particles.bodies().relative(whole);
            let point = if whole.a == pair.a {
                point
            } else {
                point + (particles.position[pair.a.index()] - particles.position[whole.a.index()])
            };
            let (force, torque) = if is_a {
                (-force, torque_on_a(&force, &point))
            } else {
                (force, torque_on_b(&force, &point, &r))
            };
            // The order of pieces differs from that of ids.
            let (normal, point) = if id_of_a < id_of_b {
                (geometry.normal, point)
            } else {
                (-geometry.normal, point - r)
            };
            let mut line = format!(
                "trace step={step} particle={id} contact={} overlap={:e} normal={} point={} normal_force={:e} \
                 force={} torque={}",
                partner.to_string().replace(' ', ""),
                geometry.overlap,
                commas(normal.as_slice()),
                commas(point.as_slice()),
                normal_force,
                commas(force.as_slice()),
                commas(torque.as_slice()),
            );
            for (column, place) in StateColumn::ranges(self.contacts.remembered()) {
                // Columns that the line has already are not repeated.
                let name = format!(" {}=", column.name);
                if !line.contains(&name) {
                    let _ = write!(line, "{name}{}", commas(&state[place]));
                }
            }
            lines.push((partner, line));
        }
        lines.sort_unstable();
        let _ = writeln!(text, " contacts={}", lines.len());
        for (_, line) in lines {
            text.push_str(&line);
            text.push('\n');
        }
        Some(text)
    }

    /// Ids of the bodies that a particle touched when contacts were last found; on all ranks.
    /// Collective.
    pub fn touched_by(&self, id: GlobalId, comm: &mut dyn Comm) -> Vec<GlobalId> {
        let particles = &self.particles;
        let pairs = self.contacts.iter().map(|(pair, _)| pair);
        let mine: Vec<GlobalId> = pairs
            .map(|pair| [pair.a, pair.b].map(|slot| particles.id[slot.index()].body()).into())
            .filter_map(|(a, b)| if a == id { Some(b) } else { (b == id).then_some(a) })
            .collect();
        // Both owners of a pair list it.
        let mut ids = everywhere(comm, &mine);
        ids.sort_unstable();
        ids.dedup();
        ids
    }
}

fn commas(numbers: &[f64]) -> String {
    numbers.iter().map(|number| format!("{number:e}")).collect::<Vec<_>>().join(",")
}
