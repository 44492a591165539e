//! Pairs of a packing, resolved alone.

use anyhow::Result;
use dem_mpi::ids::GlobalId;
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::output::snapshot::Reader;
use dem_mpi::pairs::{Body, Pairs, TooManyShapes};
use std::path::Path;

/// Pairs of particles whose bounding spheres touch: their ids, A at the origin and B at its image nearest to A.
#[derive(Clone, Debug)]
pub struct Packed(Vec<([GlobalId; 2], Body, Body)>);

impl Packed {
    /// Pairs of a snapshot.
    ///
    /// # Errors
    /// If the snapshot cannot be read.
    pub fn read(snapshot: &Path) -> Result<Self> {
        let reader = Reader::open(snapshot)?;
        let (header, table) = (reader.header(), reader.particles(0..reader.particle_count())?);
        let bodies: Vec<Body> = (0..table.id.len())
            .map(|row| {
                let rotation = table.quaternion.get(row).map_or_else(Quat::identity, |q| {
                    let [w, x, y, z] = *q;
                    Quat::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
                });
                let shape = header.shapes[table.shape[row].index()].body().into_owned();
                Body { shape, centre: table.position[row], rotation }
            })
            .collect();
        let cell = header.cell;
        let radius: Vec<f64> = bodies.iter().map(|body| body.shape.bounding_radius()).collect();
        let mut pairs = Vec::new();
        for a in 0..bodies.len() {
            for b in a + 1..bodies.len() {
                let r = cell.nearest(bodies[b].centre - bodies[a].centre);
                if r.norm() < radius[a] + radius[b] {
                    let at = |body: &Body, centre| Body { centre, ..body.clone() };
                    let ids = [table.id[a], table.id[b]];
                    pairs.push((ids, at(&bodies[a], Vec3::zeros()), at(&bodies[b], r)));
                }
            }
        }
        Ok(Self(pairs))
    }

    /// Number of pairs.
    pub const fn len(&self) -> usize {
        self.0.len()
    }

    /// True without pairs.
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Selected pairs, in the order of `which`.
    #[must_use]
    pub fn some(&self, which: &[usize]) -> Self {
        Self(which.iter().map(|&pair| self.0[pair].clone()).collect())
    }

    /// The pairs for resolvers.
    ///
    /// # Errors
    /// See [`TooManyShapes`].
    pub fn pairs(&self) -> Result<Pairs, TooManyShapes> {
        let mut pairs = Pairs::default();
        for ([a, b], body_a, body_b) in &self.0 {
            pairs.push(format!("{a}-{b}"), body_a.clone(), body_b.clone())?;
        }
        Ok(pairs)
    }
}
