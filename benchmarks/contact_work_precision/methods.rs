//! Compared methods, with their settings.

use crate::parry::{Parry, ParryErosion};
use dem_mpi::contact::{
    CommonNormal, ContactResolver, Epa, ErodedGjk, Outcome, Posed, SmoothCommonNormal,
};
use dem_mpi::math::Vec3;
use dem_mpi::shape::{Kind, Shape};

/// Methods that share a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    CommonNormal,
    Erosion,
    Epa,
    ParryErosion,
    Parry,
    /// Thickness of the common part: another overlap, which is not compared with the others.
    Thickness,
}

impl Family {
    /// Families that find one and the same overlap.
    pub(crate) const ALL: [Self; 5] =
        [Self::CommonNormal, Self::Erosion, Self::Epa, Self::ParryErosion, Self::Parry];
    /// A family of this program, and the same method in parry.
    pub(crate) const RIVALS: [(Self, Self); 2] =
        [(Self::Erosion, Self::ParryErosion), (Self::Epa, Self::Parry)];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::CommonNormal => "common normal",
            Self::Erosion => "GJK-erosion",
            Self::Epa => "GJK+EPA",
            Self::ParryErosion => "parry GJK-erosion",
            Self::Parry => "parry GJK+EPA",
            Self::Thickness => "thickness",
        }
    }
}

/// A method with its settings.
pub(crate) struct Contestant {
    pub(crate) family: Family,
    pub(crate) settings: String,
    pub(crate) resolver: Box<dyn ContactResolver>,
}

impl Contestant {
    pub(crate) fn new(
        family: Family,
        settings: String,
        resolver: impl ContactResolver + 'static,
    ) -> Self {
        Self { family, settings, resolver: Box::new(resolver) }
    }

    pub(crate) fn name(&self) -> String {
        format!("{} {}", self.family.name(), self.settings)
    }
}

/// All methods and settings that can resolve pairs of this shape.
pub(crate) fn contestants(shape: &Shape) -> Vec<Contestant> {
    let mut all = Vec::new();
    if shape.kind().is_ellipsoidal() {
        all.push(Contestant::new(Family::CommonNormal, "batch".into(), CommonNormal));
        let single = OneByOne(CommonNormal);
        all.push(Contestant::new(Family::CommonNormal, "one by one".into(), single));
    } else if shape.kind() != Kind::Polyhedron {
        let smooth = SmoothCommonNormal;
        all.push(Contestant::new(Family::CommonNormal, "one by one".into(), smooth));
    }
    let paper = ErodedGjk::default();
    let ratios = [0.01, 0.02, 0.05, 0.1].map(|ratio| ErodedGjk { ratio, ..paper });
    // The last tolerance is that of parry.
    let tolerances = [1e-3, 1e-4, 5e-8].map(|tolerance| ErodedGjk { tolerance, ..paper });
    for erosion in ratios.into_iter().chain(tolerances) {
        let settings = format!("{} % {:e}", 100.0 * erosion.ratio, erosion.tolerance);
        all.push(Contestant::new(Family::Erosion, settings, erosion));
    }
    for tolerance in [1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10] {
        all.push(Contestant::new(Family::Epa, format!("{tolerance:e}"), Epa::new(tolerance)));
    }
    all.push(Contestant::new(Family::ParryErosion, "5 %".into(), ParryErosion::of(shape)));
    all.push(Contestant::new(Family::Parry, "its own".into(), Parry::of(shape)));
    all
}

/// A resolver without its batch method for many pairs.
struct OneByOne<R>(R);

impl<R: ContactResolver> ContactResolver for OneByOne<R> {
    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        self.0.touch(a, b, r, warm)
    }
}
