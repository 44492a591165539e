//! Thickness of the volume that two bodies share, with force and moment.

use crate::math::{Mat3, Vec3};

/// A contact thinner than this part of the size has a force that is only rounding.
pub(super) const THIN: f64 = 1e-9;

/// The smaller of two bounding radii, but not so small that rounding of A's size would count as thick.
pub(super) const fn size_of_both(a: f64, b: f64) -> f64 {
    a.min(b).max(1e-4 * a)
}

/// Thickness of the volume that two bodies with faces or straight sides share.
///
/// Forces, moments and energies are over a stiffness: those for `k = 1 N/m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thickness {
    /// `D` [m].
    pub thickness: f64,
    /// Unit vector along the force of A on B.
    pub normal: Vec3,
    /// `|grad D|`: the force is `k D` times this [-]. It is 1 for flush faces.
    pub gain: f64,
    /// The point on the axis of the wrench nearest to the centroid, relative to the centre of A [m].
    pub point: Vec3,
    /// Remaining moment of A on B at that point, over the stiffness [m²].
    ///
    /// It is along the normal, and zero within rounding unless faces are twisted against each other. It has any direction where the axis is too
    /// far away for its point to be this one.
    pub couple: Vec3,
    /// Centroid of the shared volume, relative to the centre of A [m].
    pub centroid: Vec3,
    /// Covariance of the shared volume [m²].
    pub covariance: Mat3,
}

impl Thickness {
    /// Thickness with a force and its moment about the centre of A, whose axis passes near `middle`.
    pub(super) fn pressing(
        thickness: f64,
        force: Vec3,
        moment: Vec3,
        middle: Vec3,
        covariance: Mat3,
    ) -> Self {
        let rest = moment - middle.cross(&force);
        let length = force.norm();
        let normal = force / length;
        Self {
            thickness,
            normal,
            gain: length / thickness,
            point: middle + force.cross(&rest) / (length * length),
            couple: normal * rest.dot(&normal),
            centroid: middle,
            covariance,
        }
    }

    /// Force of A on B over the stiffness [m].
    pub fn force(&self) -> Vec3 {
        self.normal * (self.gain * self.thickness)
    }

    /// Moment of A on B about the centre of A over the stiffness [m²].
    pub fn moment(&self) -> Vec3 {
        self.point.cross(&self.force()) + self.couple
    }

    /// `D² / 2`: elastic energy over the stiffness [m²].
    pub fn energy(&self) -> f64 {
        0.5 * self.thickness * self.thickness
    }

    /// Copy with points relative to another centre, from which the present one is at `origin` [m].
    pub(super) fn with_origin(self, origin: &Vec3) -> Self {
        Self { point: self.point + origin, centroid: self.centroid + origin, ..self }
    }

    /// Copy in another unit of length and in the axes that are the rows of `frame`.
    pub(super) fn placed(&self, scale: f64, frame: &Mat3) -> Self {
        let square = scale * scale;
        Self {
            thickness: self.thickness * scale,
            normal: frame * self.normal,
            gain: self.gain,
            point: frame * (self.point * scale),
            couple: frame * (self.couple * square),
            centroid: frame * (self.centroid * scale),
            covariance: frame * (self.covariance * square) * frame.transpose(),
        }
    }
}
