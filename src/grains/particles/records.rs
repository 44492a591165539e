//! Data of particles in messages between ranks.
//!
//! | | a new owner gets | a new ghost's rank gets | in every step |
//! |---|---|---|---|
//! | id, shape, scale, standing | x | x | |
//! | position | x | x | x |
//! | velocity | x | x, if a law needs it | x, if a law needs it |
//! | orientation | x | x, if a shape needs it | x, if a shape needs it |
//! | angular momentum | x, unless all are spheres | | |
//! | angular velocity | x, if all are spheres | x, if a law needs it | x, if a law needs it |
//! | gains of velocities ahead | x | x, if a law needs them | x, if a law needs them |
//! | group, force, torque, accumulated quantities, image | x | | |
//! | records of touching contacts | x | | |

use super::Particles;
use super::columns::Accumulated;
use crate::ids::{GlobalId, ShapeId, Standing};
use crate::math::{Quat, Vec3};
use crate::population::Library;
use crate::shape::Kind;
use serde::{Deserialize, Serialize};

/// A particle with all its state, for a new owner or from a file. Fields that the scene does not need have default values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Particle {
    /// Id for the life of the particle.
    pub id: GlobalId,
    /// Shape.
    pub shape: ShapeId,
    /// Lengths over those of the shape [-].
    pub scale: f64,
    /// Number of its group, from 1; 0 if it belongs to none.
    pub group: u16,
    /// Centre [m].
    pub position: Vec3,
    /// Velocity [m/s].
    pub velocity: Vec3,
    /// Force at the position [N].
    pub force: Vec3,
    /// Quantities accumulated so far.
    pub accumulated: Accumulated<f64>,
    /// Place in the order of space; [`Standing::LAST`] if it has none yet.
    pub standing: Standing,
    /// Whole periods to add to the position.
    pub image: [i32; 3],
    /// Rotation from body to world.
    pub quaternion: Quat,
    /// Angular momentum, world axes [kg m²/s].
    pub angular_momentum: Vec3,
    /// Angular velocity, world axes [rad/s].
    ///
    /// For spheres alone it is the state, and the angular momentum follows from it; for others the reverse.
    pub angular_velocity: Vec3,
    /// Foreseen gains of velocity [m/s] and angular velocity [rad/s].
    pub ahead: [Vec3; 2],
    /// Torque, world axes [N m].
    pub torque: Vec3,
}

impl Particle {
    /// A particle at a scale of 1, at rest and upright.
    pub fn at_rest(id: GlobalId, shape: ShapeId, position: Vec3) -> Self {
        Self {
            id,
            shape,
            scale: 1.0,
            group: 0,
            position,
            velocity: Vec3::zeros(),
            force: Vec3::zeros(),
            accumulated: Accumulated::default(),
            standing: Standing::LAST,
            image: [0; 3],
            quaternion: Quat::identity(),
            angular_momentum: Vec3::zeros(),
            angular_velocity: Vec3::zeros(),
            ahead: [Vec3::zeros(); 2],
            torque: Vec3::zeros(),
        }
    }

    /// Copy with an angular velocity along the axes of the world [rad/s].
    #[must_use]
    pub fn spinning(self, angular_velocity: Vec3, library: &Library) -> Self {
        // L = R I Rᵀ ω
        let local = self.quaternion.inverse_transform_vector(&angular_velocity);
        let inertia = library.inertia_at(self.shape, self.scale);
        let angular_momentum = self.quaternion * inertia.component_mul(&local);
        Self { angular_momentum, angular_velocity, ..self }
    }
}

/// Reads the next numbers from bytes.
fn take<const N: usize>(rest: &mut &[u8]) -> [f64; N] {
    let (numbers, others) = rest.split_at(size_of::<[f64; N]>());
    *rest = others;
    std::array::from_fn(|k| {
        bytemuck::pod_read_unaligned(&numbers[size_of::<f64>() * k..][..size_of::<f64>()])
    })
}

impl Particles {
    /// Packs the data of these owned particles that ranks with their ghosts get in every step, in order.
    ///
    /// There are [`super::Needs::halo_values`] numbers for each particle.
    pub fn pack_halo(&self, slots: &[u32]) -> Vec<u8> {
        let mut bytes =
            Vec::with_capacity(slots.len() * size_of::<f64>() * self.needs.halo_values());
        let mut push = |values: &[f64]| bytes.extend_from_slice(bytemuck::cast_slice(values));
        for &slot in slots {
            let slot = slot as usize;
            push(self.position[slot].as_slice());
            if self.needs.velocity {
                push(self.velocity[slot].as_slice());
                if let Some(spin) = &self.spin {
                    push(spin.angular_velocity[slot].as_slice());
                }
            }
            for column in [&self.ahead.velocity, &self.ahead.angular_velocity] {
                if let Some(gain) = column.get(slot) {
                    push(gain.as_slice());
                }
            }
            if let Some(orientation) = &self.orientation {
                push(orientation.quaternion[slot].coords.as_slice());
            }
        }
        bytes
    }

    /// Unpacks data packed by [`Particles::pack_halo`] on the owner's rank into the ghosts from slot `first` on.
    ///
    /// # Panics
    /// If there are fewer ghosts than data, that is, if the ranks are out of step.
    pub fn unpack_halo(&mut self, first: usize, bytes: &[u8]) {
        let rounding = self.cell.rounding_of_images();
        let size = size_of::<f64>() * self.needs.halo_values();
        for (slot, mut rest) in (first..).zip(bytes.chunks_exact(size)) {
            let position = Vec3::from(take::<3>(&mut rest));
            let way = self.cell.moved(&self.position[slot], &position);
            let mut moved = way.norm();
            if way != position - self.position[slot] {
                moved += rounding;
            }
            self.position[slot] = position;
            if self.needs.velocity {
                self.velocity[slot] = Vec3::from(take::<3>(&mut rest));
                if let Some(spin) = &mut self.spin {
                    spin.angular_velocity[slot] = Vec3::from(take::<3>(&mut rest));
                }
            }
            for column in [&mut self.ahead.velocity, &mut self.ahead.angular_velocity] {
                if let Some(gain) = column.get_mut(slot) {
                    *gain = Vec3::from(take::<3>(&mut rest));
                }
            }
            if let Some(orientation) = &mut self.orientation {
                let coords = nalgebra::Vector4::from(take::<4>(&mut rest));
                // Exactly the owner's bits, without another normalisation.
                let quaternion = Quat::new_unchecked(coords.into());
                let shape = self.shape[slot].index();
                let scale = if self.needs.scale { self.scale[slot] } else { 1.0 };
                // The orientation of a sphere has no effect.
                if self.library.shapes[shape].kind() != Kind::Sphere {
                    // A rotation by θ moves the quaternion by 2 sin(θ/4), which is more than 2θ/2.1 / 2.
                    let turned = (quaternion.coords - orientation.quaternion[slot].coords).norm();
                    moved += 2.1 * turned * (self.library.radius[shape] * scale);
                }
                orientation.set(slot, quaternion, &self.library.shapes[shape], scale);
            }
            if let Some(travel) = self.travel.get_mut(slot) {
                *travel += moved;
            }
        }
    }

    /// Appends ghosts with these ids, shapes, standings and, if the scene needs them, scales.
    ///
    /// Their state follows with [`Particles::unpack_halo`].
    pub fn push_ghosts(&mut self, names: &[(GlobalId, ShapeId, Standing)], scales: &[f64]) {
        for &(id, shape, standing) in names {
            self.id.push(id);
            self.shape.push(shape);
            self.standing.push(standing);
        }
        self.scale.extend_from_slice(scales);
        self.ghosts += names.len();
        self.lengthen();
        if let Some(orientation) = &mut self.orientation {
            orientation.resize(self.owned + self.ghosts, self.needs);
        }
    }
}
