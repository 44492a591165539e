//! Arithmetic of tensors. Sums are exact: they have the same digits for any order of the rows, and so
//! for any number of ranks that wrote them.

use crate::math::{ExactSum, Mat3, Vec3};

/// Exact sum of tensors.
#[derive(Clone, Debug, Default)]
pub(super) struct ExactMat3 {
    /// Entries row by row.
    entries: [ExactSum; 9],
}

impl ExactMat3 {
    /// Adds `left ⊗ right`, that is `left_i right_j` in row i, column j.
    pub(super) fn add_outer(&mut self, left: &Vec3, right: &Vec3) {
        for i in 0..3 {
            for j in 0..3 {
                self.entries[3 * i + j].add(left[i] * right[j]);
            }
        }
    }

    /// The sum, rounded once.
    pub(super) fn value(&self) -> Mat3 {
        Mat3::from_fn(|i, j| self.entries[3 * i + j].value())
    }
}

/// A tensor in JSON: a list of its rows (nalgebra's own form is flat, by columns).
pub(super) mod rows {
    use crate::math::Mat3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Writes the tensor as rows.
    pub(crate) fn serialize<S: Serializer>(tensor: &Mat3, to: S) -> Result<S::Ok, S::Error> {
        <[[f64; 3]; 3]>::from(tensor.transpose()).serialize(to)
    }

    /// Reads the tensor from rows.
    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Mat3, D::Error> {
        <[[f64; 3]; 3]>::deserialize(from).map(|rows| Mat3::from(rows).transpose())
    }
}

/// `numerator / denominator`, or `None` where the quotient has no meaning.
pub fn quotient(numerator: f64, denominator: f64) -> Option<f64> {
    let value = numerator / denominator;
    value.is_finite().then_some(value)
}

/// Deviatoric part of a tensor.
pub fn deviator(tensor: &Mat3) -> Mat3 {
    tensor - Mat3::identity() * (tensor.trace() / 3.0)
}

/// `a_ij b_ij`.
pub fn inner(a: &Mat3, b: &Mat3) -> f64 {
    a.component_mul(b).sum()
}
