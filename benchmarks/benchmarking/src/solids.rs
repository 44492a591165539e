//! Corners of solids.

use dem_grains::math::Vec3;

/// Corners of a cuboid with these full edges.
pub fn cuboid(edges: Vec3) -> Vec<Vec3> {
    let side = |k: u32, i: usize| if k >> i & 1 == 1 { 0.5 * edges[i] } else { -0.5 * edges[i] };
    (0..8).map(|k| Vec3::from_fn(|i, _| side(k, i))).collect()
}

/// Corners of an irregular tetrahedron.
pub fn tetrahedron() -> Vec<Vec3> {
    [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.9, -0.1], [0.3, 0.2, 0.8]].map(Vec3::from).to_vec()
}

/// Corners of an icosahedron with edges of length 1.
pub fn icosahedron() -> Vec<Vec3> {
    let golden = 0.5 * (1.0 + 5_f64.sqrt());
    let corner = |k: u32| {
        let sign = |bit: u32| if k >> bit & 1 == 1 { 0.5 } else { -0.5 };
        let (one, other) = (sign(0), sign(1) * golden);
        match k >> 2 {
            0 => Vec3::new(0.0, one, other),
            1 => Vec3::new(one, other, 0.0),
            _ => Vec3::new(other, 0.0, one),
        }
    };
    (0..12).map(corner).collect()
}
