//! Spatial views of a snapshot: force chains, profiles by height, velocities.
//!
//! They are drawn within the box of the report, which must be known first: [`Views::of`] reads the files again.

mod chains;
mod field;
mod profile;

use super::draw::PlotError;
use super::plots::Plot;
use super::walls::Walls;
use crate::math::Vec3;
use crate::output::header::Header;
use crate::output::snapshot::Reader;
use crate::output::tables::{ContactTable, ParticleTable};
use crate::post::region::{Bounds, Margin, Turned};
use crate::post::{PostError, pieces};
use chains::Chains;
use field::Field;
pub use profile::{Layer, Profile};

/// All views of a snapshot.
#[derive(Clone, Debug)]
pub struct Views {
    bounds: Bounds,
    walls: Walls,
    chains: Chains,
    field: Field,
    /// Averages by height.
    pub profile: Profile,
}

impl Views {
    /// Views within a box, from the files of a snapshot.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn of(reader: &Reader, bounds: &Bounds) -> Result<Self, PostError> {
        let diameter = Margin::Diameters(1.0).metres(reader)?;
        let mut views = Self::new(reader.header(), bounds, diameter);
        for rows in pieces(reader.particle_count()) {
            views.add_particles(reader.header(), &reader.particles(rows)?);
        }
        for rows in pieces(reader.contact_count()?) {
            views.add_contacts(reader.header(), &reader.contacts(rows)?);
        }
        Ok(views)
    }

    /// Empty views; particles have about this diameter [m].
    pub fn new(header: &Header, bounds: &Bounds, diameter: f64) -> Self {
        Self {
            bounds: *bounds,
            walls: Walls::of(header),
            chains: Chains::new(diameter),
            field: Field::new(bounds, diameter),
            profile: Profile::new(header, bounds, diameter),
        }
    }

    /// Adds particles.
    pub fn add_particles(&mut self, header: &Header, particles: &ParticleTable) {
        for (row, centre) in particles.position.iter().enumerate() {
            if !is_over(header, &self.bounds, centre) {
                continue;
            }
            let body = Turned::of(header, particles, row);
            let shape = &header.shapes[particles.shape[row].index()];
            let ratio = particles.volume_ratio(row);
            self.profile.add_body(centre, &body, shape.volume * ratio, shape.mass * ratio);
            self.field.add(centre, &particles.velocity[row], shape.mass * ratio);
        }
    }

    /// Adds contacts. If the partner is outside the box, the contact counts with the arm of the particle inside, as in the stress
    /// of the report.
    pub fn add_contacts(&mut self, header: &Header, contacts: &ContactTable) {
        for row in 0..contacts.a.len() {
            let (centre, branch) = (contacts.centre[row], contacts.branch[row]);
            let (force, other) = (contacts.force(row), centre + branch);
            let from_a = contacts.point[row] - centre;
            let is_wall = contacts.b[row].wall_index().is_some();
            let is_a_in = is_over(header, &self.bounds, &centre);
            let is_b_in = !is_wall && is_over(header, &self.bounds, &other);
            match (is_a_in, is_b_in || is_wall) {
                (true, true) => self.profile.add_contact(&centre, &branch, &force),
                (true, false) => self.profile.add_contact(&centre, &from_a, &force),
                (false, _) if is_b_in => {
                    self.profile.add_contact(&other, &(from_a - branch), &-force);
                }
                (false, _) => {}
            }
            // Drawn from A; the other end may lie beyond a period.
            if is_a_in && (self.bounds.low.z..=self.bounds.high.z).contains(&centre.z) {
                self.chains.add(&centre, &branch, contacts.normal_force[row]);
            }
        }
    }

    /// Plots of the views that are not empty.
    ///
    /// # Errors
    /// See [`PlotError`].
    pub fn plots(&self) -> Result<Vec<Plot>, PlotError> {
        let mut plots = Vec::new();
        plots.extend(self.chains.plot(&self.bounds, &self.walls));
        plots.extend(self.field.plot(&self.bounds, &self.walls));
        plots.extend(self.profile.plots()?);
        Ok(plots)
    }
}

/// True if a centre, or its image in the domain, is within the four upright sides of a box. Boxes that share a side share no
/// centre.
fn is_over(header: &Header, bounds: &Bounds, centre: &Vec3) -> bool {
    let place = header.cell.inside(*centre);
    (0..2).all(|k| bounds.low[k] <= place[k] && place[k] < bounds.high[k])
}
