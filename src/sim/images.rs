//! Work of images that move against the bodies of the cell, through the contacts.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use crate::contacts::{Visited, Visitor};
use crate::lanes::Eight;
use crate::particles::Particles;

/// Adds the work to the received energy, half to each body.
pub(super) struct WorkOfImages<'a> {
    pub(super) particles: &'a Particles,
    /// Times before and ahead, see [`crate::cell::Cell::work_on_nearest`] [s].
    pub(super) times: [f64; 2],
    /// Received energies of owned bodies [J].
    pub(super) received: &'a mut [f64],
}

impl Visitor for WorkOfImages<'_> {
    #[inline(always)]
    fn visit<L: Eight>(&mut self, contacts: &Visited<L>) {
        let Self { particles, times, received } = self;
        let Visited { bodies: [a, b], count, way, force } = *contacts;
        let work = particles.cell.work_on_nearest(way, force, *times);
        let shares = (L::all(-0.5) * work).store();
        // Terms of a body come in the spatial order of its partners.
        for (lane, share) in shares.into_iter().enumerate().take(count) {
            for slot in [a.at(lane), b.at(lane)] {
                if share != 0.0
                    && let Some(received) = received.get_mut(slot)
                {
                    *received += share;
                }
            }
        }
    }
}
