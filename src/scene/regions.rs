//! Regions in which particles appear or leave, from the parsed file to [`Region`].

use super::reader::{Given, Section};
use crate::cell::AXES;
use crate::drive::region::Region;
use crate::math::Vec3;

/// A plane (of an outlet), a box or a cylinder.
pub(super) fn region(section: &Section, is_outlet: bool) -> Option<Region> {
    let read = |key| section.get(key).map(|given| (given.vector(), given));
    let plane = if is_outlet { [read("point"), read("normal")] } else { [None, None] };
    let corners = [read("low"), read("high")];
    let axis = section.get("axis").map(|given| (given.list_of(Given::vector), given));
    let radius = section.get("radius").map(|given| given.number());
    match (plane, corners, axis, radius) {
        ([Some((point, _)), Some((normal, given))], [None, None], None, None) => {
            let (point, normal) = (point?, normal?);
            if normal == Vec3::zeros() {
                given.fail("must not be 0");
                return None;
            }
            Some(Region::Behind { point, normal: normal.normalize() })
        }
        ([None, None], [Some((low, _)), Some((high, given))], None, None) => {
            let (low, high) = (low?, high?);
            let is_wrong =
                |&axis: &usize| high[axis] < low[axis] || (is_outlet && high[axis] <= low[axis]);
            if let Some(axis) = (0..3).find(is_wrong) {
                given.fail(format!("must be above `low` along {}", AXES[axis]));
                return None;
            }
            Some(Region::Box { low, high })
        }
        ([None, None], [None, None], Some((ends, given)), Some(radius)) => {
            let (axis, radius) = (ends?, radius?);
            if axis[0] == axis[1] {
                given.fail("both ends are the same point; also a flat region needs a small length");
                return None;
            }
            Some(Region::Cylinder { axis, radius })
        }
        _ => {
            let plane = if is_outlet { "`point` and `normal`, " } else { "" };
            section.fail(format!(
                "give a region: {plane}`low` and `high`, or `axis` and `radius` of a cylinder"
            ));
            None
        }
    }
}
