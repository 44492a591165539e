//! Energy balance of a contact between two steps: it loses the work of its forces minus the energy that they store.

use crate::lanes::Lanes;
use crate::law::Losses;

/// Powers of the forces on both bodies, summed over the last step and now [W]. In a contact that has ended only those of
/// the last step count.
#[derive(Clone, Copy, Debug)]
pub(super) struct Powers<L> {
    /// Power of normal forces.
    pub(super) pressing: L,
    /// Power of tangential forces, and of torsion where bodies touch with an extent.
    pub(super) rubbing: L,
    /// Power of the moment of a model with moments.
    pub(super) turning: Option<L>,
    /// Power of tangential dashpots, if there are any: the part of `rubbing` that is not friction's; 0 where friction is at
    /// its limit.
    pub(super) damping: Option<L>,
}

/// Elastic energies [J].
#[derive(Clone, Copy, Debug)]
pub(super) struct Stored<L> {
    /// Energy of normal forces; 0 where `pressing` counts dashpots alone.
    pub(super) pressing: L,
    /// Energy of tangential forces, torsion and moments.
    pub(super) rubbing: L,
    /// Part of moments.
    pub(super) turning: L,
}

impl<L: Lanes> Stored<L> {
    /// Energies of an action, see [`super::Action::stored`].
    #[inline(always)]
    pub(super) fn of([pressing, rubbing]: [L; 2], turning: L) -> Self {
        Self { pressing, rubbing, turning }
    }

    #[inline(always)]
    pub(super) fn none() -> Self {
        let zero = L::all(0.0);
        Self { pressing: zero, rubbing: zero, turning: zero }
    }
}

impl<L: Lanes> Losses<L> {
    #[inline(always)]
    pub(super) fn none() -> Self {
        let zero = L::all(0.0);
        Self { all: zero, of_friction: zero, parts: [zero; 3] }
    }
}

impl<L: Lanes> Powers<L> {
    /// Losses over half a step [s], for contacts that can dissipate along the normal, and otherwise.
    #[inline(always)]
    pub(super) fn balance(
        self,
        [before, now]: [Stored<L>; 2],
        half_step: L,
        [normally, beside]: [u8; 2],
    ) -> Losses<L> {
        let zero = L::all(0.0);
        let pressed = half_step * self.pressing - (now.pressing - before.pressing);
        let (mut power, mut of_turning, mut of_dashpots) = (self.rubbing, zero, zero);
        if let Some(turning) = self.turning {
            power = power + turning;
            of_turning = half_step * turning - (now.turning - before.turning);
            of_turning = of_turning.or(zero, beside);
        }
        let rubbed = half_step * power - (now.rubbing - before.rubbing);
        let rubbed = rubbed.or(zero, beside);
        if let Some(damping) = self.damping {
            of_dashpots = half_step * damping;
        }
        Losses {
            all: pressed.or(zero, normally) + rubbed,
            of_friction: rubbed - of_turning - of_dashpots,
            parts: [of_dashpots, of_turning, zero],
        }
    }
}

impl Powers<f64> {
    /// Sums of both.
    pub(super) fn and(self, other: Self) -> Self {
        let both = |a: Option<f64>, b: Option<f64>| Some(a? + b?);
        Self {
            pressing: self.pressing + other.pressing,
            rubbing: self.rubbing + other.rubbing,
            turning: both(self.turning, other.turning),
            damping: both(self.damping, other.damping),
        }
    }
}
