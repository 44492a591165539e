//! What stands where in the packing of a snapshot: force chains, profiles by height, velocities.
//!
//! They are drawn within the box of the report, which must be known first: [`Views::of`] reads the files once more.

mod chains;
mod field;
mod profile;

use super::draw::PlotError;
use super::plots::Plot;
use super::region::{Bounds, Margin, Turned};
use super::{PostError, pieces};
use crate::math::Vec3;
use crate::output::header::Header;
use crate::output::snapshot::Reader;
use crate::output::tables::{ContactTable, ParticleTable};
use chains::Chains;
use field::Field;
pub use profile::{Layer, Profile};

/// All of a snapshot.
#[derive(Clone, Debug)]
pub struct Views {
    bounds: Bounds,
    chains: Chains,
    field: Field,
    /// Averages by height.
    pub profile: Profile,
}

impl Views {
    /// Within a box, from its files.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn of(reader: &Reader, bounds: &Bounds) -> Result<Self, PostError> {
        let diameter = Margin::Diameters(1.0).metres(reader)?;
        let mut views = Self::new(reader.header(), bounds, diameter);
        for rows in pieces(reader.particle_count()) {
            views.add_particles(reader.header(), &reader.particles(rows)?);
        }
        for rows in pieces(reader.contact_count()?) {
            views.add_contacts(&reader.contacts(rows)?);
        }
        Ok(views)
    }

    /// Of nothing yet; grains have this diameter, about [m].
    pub fn new(header: &Header, bounds: &Bounds, diameter: f64) -> Self {
        Self {
            bounds: *bounds,
            chains: Chains::new(diameter),
            field: Field::new(bounds, diameter),
            profile: Profile::new(header, bounds, diameter),
        }
    }

    /// Adds particles.
    pub fn add_particles(&mut self, header: &Header, particles: &ParticleTable) {
        for (row, centre) in particles.position.iter().enumerate() {
            if !is_over(&self.bounds, centre) {
                continue;
            }
            let body = Turned::of(header, particles, row);
            let shape = &header.shapes[particles.shape[row].index()];
            let ratio = particles.volume_ratio(row);
            self.profile.add_body(centre, &body, shape.volume * ratio, shape.mass * ratio);
            self.field.add(centre, &particles.velocity[row], shape.mass * ratio);
        }
    }

    /// Adds contacts.
    pub fn add_contacts(&mut self, contacts: &ContactTable) {
        for row in 0..contacts.a.len() {
            let (centre, branch) = (contacts.centre[row], contacts.branch[row]);
            // The other end may lie beyond a period.
            if !is_over(&self.bounds, &centre) {
                continue;
            }
            self.profile.add_contact(&centre, &branch, &contacts.force(row));
            if (self.bounds.low.z..=self.bounds.high.z).contains(&centre.z) {
                self.chains.add(&centre, &branch, contacts.normal_force[row]);
            }
        }
    }

    /// Those in which there is something.
    ///
    /// # Errors
    /// See [`PlotError`].
    pub fn plots(&self) -> Result<Vec<Plot>, PlotError> {
        let mut plots = Vec::new();
        plots.extend(self.chains.plot(&self.bounds));
        plots.extend(self.field.plot(&self.bounds));
        plots.extend(self.profile.plots()?);
        Ok(plots)
    }
}

/// Is a point within the four upright sides of a box?
fn is_over(bounds: &Bounds, point: &Vec3) -> bool {
    (0..2).all(|k| (bounds.low[k]..=bounds.high[k]).contains(&point[k]))
}
