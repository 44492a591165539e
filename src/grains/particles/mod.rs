//! Columns of all bodies that a rank owns or sees.
//!
//! The order of slots is owned | ghosts | pieces of unions | facets of walls. Pieces and facets have the poses that their bodies give them. A
//! column that the scene does not need does not exist: spheres without friction have no rotation, and a scene of spheres only has no
//! orientations.

pub mod columns;
#[doc(hidden)]
pub mod crowd;
mod facets;
pub mod order;
pub mod pieces;
pub mod records;

use crate::cell::Cell;
use crate::contact::{Bodies, Pair, Posed};
use crate::ids::{GlobalId, MaterialId, ShapeId, Slot, Standing};
use crate::lanes::Triple;
use crate::math::{Quat, Vec3, Vec3AndNumber};
use crate::population::Library;
use crate::shape::{Form, Shape};
use crate::walls::{FacetColumns, Wall};
use columns::Accumulated;
pub use columns::Needs;
use pieces::PieceColumns;
use records::Particle;

/// Rotation columns, where the scene needs them.
#[derive(Clone, Debug, Default)]
pub struct Spin {
    /// Angular momentum, world axes [kg m²/s]. Length: owned, or none if all are spheres.
    pub angular_momentum: Vec<Vec3>,
    /// Angular velocity, world axes, for the laws [rad/s]. Length: all slots.
    ///
    /// For spheres alone it is the state. For others it is that of the last rotation, before the second kick, see
    /// [`Particles::angular_velocity`].
    pub angular_velocity: Vec<Vec3>,
    /// Torque, world axes [N m], and a zero: four numbers are added at once. Length: owned.
    pub torque: Vec<Vec3AndNumber>,
}

/// Foreseen gains of velocities until the time of the positions, see [`crate::motion::ahead`]; zero for walls.
///
/// Length: all slots, or none if the scene does not need them.
#[derive(Clone, Debug, Default)]
pub struct Ahead {
    /// Gain of the velocity [m/s].
    pub velocity: Vec<Vec3>,
    /// Gain of the angular velocity, world axes [rad/s].
    pub angular_velocity: Vec<Vec3>,
}

/// Orientation columns, where the scene needs them.
#[derive(Clone, Debug, Default)]
pub struct Orientation {
    /// Rotation from body to world. Length: owned + ghosts + pieces.
    pub quaternion: Vec<Quat>,
    /// Matrices of ellipsoids in place, if a method needs them. Length: owned + ghosts + pieces, or none.
    pub form: Vec<Form>,
}

impl Orientation {
    /// Sets the orientation of a body of this shape and scale.
    #[inline]
    pub fn set(&mut self, slot: usize, quaternion: Quat, shape: &Shape, scale: f64) {
        self.quaternion[slot] = quaternion;
        if let Some(form) = self.form.get_mut(slot) {
            let frame = quaternion.to_rotation_matrix().into_inner();
            *form = Posed { scale, ..Posed::new(shape, &frame) }.form();
        }
    }

    /// Changes the number of bodies; new ones are upright.
    fn resize(&mut self, bodies: usize, needs: Needs) {
        self.quaternion.resize(bodies, Quat::identity());
        if needs.form {
            self.form.resize(bodies, [f64::NAN; 6]);
        }
    }
}

/// Memory that a column holds [bytes].
pub fn held<T>(column: &Vec<T>) -> usize {
    column.capacity() * size_of::<T>()
}

/// Frees most of the excess capacity of a list whose length changes from step to step: growth has doubled it.
pub fn trim<T>(list: &mut Vec<T>) {
    if list.capacity() > list.len() + list.len() / 16 {
        list.shrink_to(list.len() + list.len() / 32);
    }
}

/// Particles with a common name, which are held or pushed together.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Name in the scene.
    pub name: String,
    /// Point about which the torque on the group is computed: the present reference point of a rotating group [m].
    pub about: Option<Vec3>,
}

/// All bodies of a rank.
#[derive(Clone, Debug)]
pub struct Particles {
    /// Columns that exist.
    pub needs: Needs,
    /// Data shared by particles of one shape.
    pub library: Library,
    /// Number of owned particles. Slots `0..owned` are owned, `owned..owned + ghosts` ghosts, followed by pieces and walls.
    pub owned: usize,
    /// Number of ghosts.
    pub ghosts: usize,
    /// Ids. Length: all slots.
    pub id: Vec<GlobalId>,
    /// Shapes. Length: all slots.
    pub shape: Vec<ShapeId>,
    /// Lengths of each body over those of its shape; 1 for walls [-]. Length: all slots, or none.
    pub scale: Vec<f64>,
    /// Number of each particle's group, from 1; 0 without a group. Length: owned or none.
    pub group: Vec<u16>,
    /// Place in the order of space. Length: all slots.
    pub standing: Vec<Standing>,
    /// Centres, wrapped into the domain along periodic axes [m]. Length: all slots.
    pub position: Vec<Vec3>,
    /// Velocities [m/s]. Length: all slots.
    ///
    /// After a step they are those at the time of the positions. Before its second kick, and for ghosts, they are those of half a step before.
    pub velocity: Vec<Vec3>,
    /// Foreseen gains of velocities, if a law needs them.
    pub ahead: Ahead,
    /// Sum of the contact forces without gravity and damping [N], and the energy that contacts lost in the last step [J].
    ///
    /// Four numbers are added at once. Length: owned.
    pub force: Vec<Vec3AndNumber>,
    /// Positions when the pairs were listed [m]. Length: owned.
    pub listed_at: Vec<Vec3>,
    /// Largest displacement of any point of the body since the pairs were listed, along its way [m].
    ///
    /// Length: all slots, once the pairs are listed.
    pub travel: Vec<f64>,
    /// Accumulated quantities of each particle. Length: owned, or none for those that the scene does not need.
    pub accumulated: Accumulated<Vec<f64>>,
    /// Whole periods to add to the position, in a periodic domain. Length: owned or none.
    pub image: Vec<[i32; 3]>,
    /// Rotation, if any shape or law needs it.
    pub spin: Option<Spin>,
    /// Orientation, if any shape needs it.
    pub orientation: Option<Orientation>,
    /// Domain with its periodicity.
    pub cell: Cell,
    /// Walls, the same on all ranks.
    pub walls: Vec<Wall>,
    /// Groups by their numbers, the same on all ranks.
    pub groups: Vec<Group>,
    /// Columns of facets of walls.
    pub facets: FacetColumns,
    /// Columns of pieces of unions.
    pub pieces: PieceColumns,
    /// Facets of meshes that have slots: those near the owned particles when the pairs were listed, in rising order.
    pub near_facets: Vec<GlobalId>,
}

impl Particles {
    /// Columns without particles, with walls only.
    pub fn new(needs: Needs, mut library: Library, walls: Vec<Wall>, cell: Cell) -> Self {
        for mesh in walls.iter().filter_map(|wall| wall.mesh.as_ref()) {
            // A scene received from another rank has each surface twice.
            library.shapes[mesh.shape.index()] = Shape::TriangleMesh(mesh.surface.clone());
        }
        let mut particles = Self {
            needs,
            library,
            owned: 0,
            ghosts: 0,
            id: Vec::new(),
            shape: Vec::new(),
            scale: Vec::new(),
            group: Vec::new(),
            standing: Vec::new(),
            position: Vec::new(),
            velocity: Vec::new(),
            ahead: Ahead::default(),
            force: Vec::new(),
            listed_at: Vec::new(),
            travel: Vec::new(),
            accumulated: Accumulated::default(),
            image: Vec::new(),
            spin: needs.spin.then(Spin::default),
            orientation: needs.orientation.then(Orientation::default),
            cell,
            walls,
            groups: Vec::new(),
            facets: FacetColumns::default(),
            pieces: PieceColumns::default(),
            near_facets: Vec::new(),
        };
        particles.append_pieces_and_walls();
        particles
    }

    /// Shears the cell by a step of `dt` [s]. Two bodies may come nearer by the sliding distance of the images.
    pub fn move_cell(&mut self, dt: f64) {
        let slid = 0.5 * dt * self.cell.velocity_above().norm();
        if slid > 0.0 {
            self.cell.advance(dt);
            let bodies = self.first_facet();
            for travel in &mut self.travel[..bodies] {
                *travel += slid;
            }
        }
    }

    /// Velocity of the image of B that A interacts with, relative to B itself [m/s]; zero if no image slides.
    ///
    /// For pieces it is that of their bodies, which a flow does not rotate.
    #[inline]
    pub fn sliding_of_image(&self, pair: Pair) -> Vec3 {
        let [a, b] = [pair.a, pair.b].map(|slot| self.body_of(slot).index());
        let apart = self.position[b] - self.position[a];
        self.cell.velocity_of_nearest_midway(&apart, &(self.velocity[b] - self.velocity[a]))
    }

    /// Work [J] of a force [N] through a contact, see [`Cell::work_on_nearest`]; times in s.
    pub fn work_on_image(&self, pair: Pair, force: &Vec3, times: [f64; 2]) -> f64 {
        let Pair { a, b } = self.bodies_of(pair);
        let way = self.position[b.index()] - self.position[a.index()];
        let [way, force] = [&way, force].map(|v| Triple { x: v.x, y: v.y, z: v.z });
        self.cell.work_on_nearest(way, force, times)
    }

    /// Bodies for contact resolution.
    pub fn bodies(&self) -> Bodies<'_> {
        Bodies {
            position: &self.position,
            quaternion: self.orientation.as_ref().map(|a| &a.quaternion[..]),
            form: self.orientation.as_ref().filter(|_| self.needs.form).map(|a| &a.form[..]),
            facets: &self.facets.place,
            shape: &self.shape,
            library: &self.library.shapes,
            curvature_radius: &self.library.curvature_radius,
            scale: self.needs.scale.then_some(&self.scale[..]),
            cell: &self.cell,
        }
    }

    /// Number of slots.
    pub fn slots(&self) -> usize {
        self.id.len()
    }

    /// Name of a body in messages.
    pub fn body_name(&self, id: GlobalId) -> String {
        let Some((wall, facet)) = id.wall_and_facet() else { return format!("particle {id}") };
        let wall = &self.walls[wall];
        format!("{}wall \"{}\"", wall.facet_name(facet), wall.name)
    }

    /// Lengths of a body over those of its shape [-].
    #[inline]
    pub fn scale_of(&self, slot: usize) -> f64 {
        if self.needs.scale { self.scale[slot] } else { 1.0 }
    }

    /// Whether the slot is a particle that is held on its course, whatever acts on it.
    #[inline]
    pub fn is_held(&self, slot: usize) -> bool {
        self.library.is_held(self.shape[slot])
    }

    /// Index of the group of an owned particle, if it belongs to one.
    pub fn group_of(&self, slot: usize) -> Option<usize> {
        (*self.group.get(slot)? as usize).checked_sub(1)
    }

    /// Radius of the smallest sphere about the centre of a body [m].
    #[inline]
    pub fn radius(&self, slot: usize) -> f64 {
        self.library.radius[self.shape[slot].index()] * self.scale_of(slot)
    }

    /// Whether the bounding box of a body's bounding sphere overlaps a box with this middle and these half lengths [m].
    ///
    /// The nearest periodic image of the body counts.
    pub fn comes_into(&self, slot: usize, middle: &Vec3, half: &Vec3) -> bool {
        let apart = self.cell.nearest(self.position[slot] - middle).abs();
        (0..3).all(|axis| apart[axis] < half[axis] + self.radius(slot))
    }

    /// Radius of the largest sphere about the centre inside a body [m].
    pub fn inscribed_radius(&self, slot: usize) -> f64 {
        self.library.shapes[self.shape[slot].index()].inscribed_radius() * self.scale_of(slot)
    }

    /// Mass of a body [kg].
    #[inline]
    pub fn mass(&self, slot: usize) -> f64 {
        self.library.mass_at(self.shape[slot], self.scale_of(slot))
    }

    /// Volume of a body [m³].
    pub fn volume(&self, slot: usize) -> f64 {
        self.library.shapes[self.shape[slot].index()].volume() * self.scale_of(slot).powi(3)
    }

    /// Principal moments of inertia of a body [kg m²].
    #[inline]
    pub fn inertia(&self, slot: usize) -> Vec3 {
        self.library.inertia_at(self.shape[slot], self.scale_of(slot))
    }

    /// Material of a body.
    #[inline]
    pub fn material(&self, slot: Slot) -> MaterialId {
        self.library.materials[self.shape[slot.index()].index()]
    }

    /// Velocity of the material point of a body at `arm` from its centre, world axes [m/s].
    #[inline]
    pub fn velocity_at(&self, slot: Slot, arm: &Vec3) -> Vec3 {
        let velocity = self.velocity[slot.index()];
        match &self.spin {
            Some(spin) => velocity + spin.angular_velocity[slot.index()].cross(arm),
            None => velocity,
        }
    }

    /// Angular velocity of a body; 0 without rotation [rad/s].
    pub fn angular_velocity_of(&self, slot: Slot) -> Vec3 {
        self.spin.as_ref().map_or_else(Vec3::zeros, |spin| spin.angular_velocity[slot.index()])
    }

    /// Frees memory that more particles have needed.
    pub fn trim(&mut self) {
        self.each_column(|column| column.shrink_to_fit());
    }

    /// Removes ghosts and walls, so that owned particles may be added and removed.
    pub fn strip_to_owned(&mut self) {
        let owned = self.owned;
        self.ghosts = 0;
        self.facets = FacetColumns::default();
        self.pieces = PieceColumns::default();
        self.each_column(|column| column.truncate(owned));
        // It belongs to a list of pairs that is no longer valid.
        self.travel.clear();
    }

    /// Adds an owned particle. Ghosts and walls must have been removed.
    ///
    /// # Panics
    /// If [`Library::admit`] was not called with its scale, which determines the width of halo and grids.
    pub fn push_owned(&mut self, particle: &Particle) {
        // All fields are named, so that a new one does not compile before its place is decided.
        let Particle {
            id,
            shape,
            scale,
            group,
            position,
            velocity,
            force,
            accumulated,
            standing,
            image,
            quaternion,
            angular_momentum,
            angular_velocity,
            ahead,
            torque,
        } = particle;
        let [least, largest] = self.library.scales[shape.index()];
        assert!(
            (least..=largest).contains(scale),
            "particle {id} has scale {scale}, outside the range {least} to {largest} of the library"
        );
        self.id.push(*id);
        self.shape.push(*shape);
        if self.needs.scale {
            self.scale.push(*scale);
        }
        if self.needs.group {
            self.group.push(*group);
        }
        self.standing.push(*standing);
        self.position.push(*position);
        self.velocity.push(*velocity);
        if self.needs.ahead {
            self.ahead.velocity.push(ahead[0]);
            self.ahead.angular_velocity.extend(self.needs.spin.then_some(ahead[1]));
        }
        self.force.push((*force).into());
        self.listed_at.push(*position);
        self.accumulated.push(accumulated, self.needs);
        if self.needs.image {
            self.image.push(*image);
        }
        if let Some(orientation) = &mut self.orientation {
            let slot = self.owned;
            orientation.resize(slot + 1, self.needs);
            orientation.set(slot, *quaternion, &self.library.shapes[shape.index()], *scale);
        }
        self.owned += 1;
        let angular_velocity = match &self.orientation {
            Some(_) => self.angular_velocity_for(self.owned - 1, angular_momentum),
            None => *angular_velocity,
        };
        if let Some(spin) = &mut self.spin {
            if self.needs.orientation {
                spin.angular_momentum.push(*angular_momentum);
            }
            spin.angular_velocity.push(angular_velocity);
            spin.torque.push((*torque).into());
        }
    }

    /// Adds an owned particle whose rotation in this step was computed by another rank, with that angular velocity.
    ///
    /// # Panics
    /// See [`Particles::push_owned`].
    pub fn adopt(&mut self, particle: &Particle) {
        self.push_owned(particle);
        if let Some(spin) = &mut self.spin {
            spin.angular_velocity[self.owned - 1] = particle.angular_velocity;
        }
    }

    /// An owned particle with all its state.
    pub fn owned_particle(&self, slot: usize) -> Particle {
        let spin = self.spin.as_ref();
        let orientation = self.orientation.as_ref();
        Particle {
            id: self.id[slot],
            shape: self.shape[slot],
            scale: self.scale_of(slot),
            group: self.group.get(slot).copied().unwrap_or_default(),
            position: self.position[slot],
            velocity: self.velocity[slot],
            force: self.force[slot].vector,
            accumulated: self.accumulated.row(slot),
            standing: self.standing[slot],
            image: self.image.get(slot).copied().unwrap_or_default(),
            quaternion: orientation
                .map_or_else(Quat::identity, |orientation| orientation.quaternion[slot]),
            angular_momentum: self.angular_momentum(slot),
            angular_velocity: spin.map_or_else(Vec3::zeros, |spin| spin.angular_velocity[slot]),
            ahead: self.ahead_of(slot),
            torque: spin.map_or_else(Vec3::zeros, |spin| spin.torque[slot].vector),
        }
    }

    /// Removes an owned particle and returns it; the last owned one moves to its slot. Ghosts and walls must have been removed.
    pub fn take_owned(&mut self, slot: usize) -> Particle {
        let particle = self.owned_particle(slot);
        self.each_column(|column| column.take_out(slot));
        self.owned -= 1;
        particle
    }

    /// Angular momentum of an owned particle; zero if the scene does not need it [kg m²/s].
    #[inline]
    pub fn angular_momentum(&self, slot: usize) -> Vec3 {
        let Some(spin) = &self.spin else { return Vec3::zeros() };
        let of_sphere = || spin.angular_velocity[slot] * self.inertia(slot).x;
        spin.angular_momentum.get(slot).copied().unwrap_or_else(of_sphere)
    }

    /// Angular velocity of an owned particle; zero if the scene does not need it [rad/s].
    pub fn angular_velocity(&self, slot: usize) -> Vec3 {
        match &self.spin {
            Some(_) if self.needs.orientation => {
                self.angular_velocity_for(slot, &self.angular_momentum(slot))
            }
            Some(spin) => spin.angular_velocity[slot],
            None => Vec3::zeros(),
        }
    }

    /// Angular velocity of a particle with this angular momentum in its orientation: `R I⁻¹ Rᵀ L`.
    #[inline]
    pub fn angular_velocity_for(&self, slot: usize, momentum: &Vec3) -> Vec3 {
        let inertia = &self.inertia(slot);
        match &self.orientation {
            Some(orientation) => {
                let frame = orientation.quaternion[slot].to_rotation_matrix().into_inner();
                frame * frame.tr_mul(momentum).component_div(inertia)
            }
            None => momentum / inertia.x,
        }
    }

    /// Foreseen gains of the velocity [m/s] and the angular velocity [rad/s] of a body.
    pub fn ahead_of(&self, slot: usize) -> [Vec3; 2] {
        let Ahead { velocity, angular_velocity } = &self.ahead;
        [velocity, angular_velocity].map(|column| column.get(slot).copied().unwrap_or_default())
    }

    /// Extends the columns of all slots to the number of ids.
    fn lengthen(&mut self) {
        let slots = self.id.len();
        self.standing.resize(slots, Standing::LAST);
        if self.needs.scale {
            self.scale.resize(slots, 1.0);
        }
        self.position.resize(slots, Vec3::zeros());
        self.velocity.resize(slots, Vec3::zeros());
        if self.needs.ahead {
            self.ahead.velocity.resize(slots, Vec3::zeros());
        }
        if self.needs.ahead && self.needs.spin {
            self.ahead.angular_velocity.resize(slots, Vec3::zeros());
        }
        if let Some(spin) = &mut self.spin {
            spin.angular_velocity.resize(slots, Vec3::zeros());
        }
    }
}
