//! Exact overlap of two convex polyhedra, from all facets of their Minkowski difference.
//!
//! Each facet is a face of A, a face of B, or spanned by an edge of either. In the last case the arcs of the edges
//! cross on the sphere of normals (Gregorius 2013, "The separating axis test between convex polyhedra", GDC). The
//! number of facets grows with the product of the numbers of edges. The method is a reference, too slow for
//! simulations.

use dem_mpi::contact::Posed;
use dem_mpi::math::Vec3;
use dem_mpi::shape::Core;
use dem_mpi::shape::hull::Hull;

/// A plane of the difference of two bodies about one centre: `x · normal <= height`.
struct Facet {
    normal: Vec3,
    height: f64,
}

/// An edge and the normals of the two adjacent faces, in world axes.
struct Edge {
    from: Vec3,
    along: Vec3,
    normals: [Vec3; 2],
}

/// Places B in this direction from A with the requested overlap (a clearance along a facet, if negative). Returns the
/// centre of B and the normal.
pub(crate) fn placed(a: &Posed, b: &Posed, towards: &Vec3, overlap: f64) -> (Vec3, Vec3) {
    // The overlap at a distance d is the least of `height - d normal · towards`.
    let far = facets(a, b).into_iter().filter(|facet| facet.normal.dot(towards) > 0.0);
    let distances = far.map(|f| ((f.height - overlap) / f.normal.dot(towards), f.normal));
    let (distance, normal) = distances
        .min_by(|(one, _), (other, _)| one.total_cmp(other))
        .expect("some facet of a closed body faces every direction");
    (towards * distance, normal)
}

fn facets(a: &Posed, b: &Posed) -> Vec<Facet> {
    let facet = |normal: Vec3| {
        let height = a.support(&normal).dot(&normal) - b.support(&-normal).dot(&normal);
        Facet { normal, height }
    };
    let faces = |body: &Posed| -> Vec<Vec3> {
        hull(body).planes().iter().map(|plane| body.frame * plane.normal).collect()
    };
    let mut all: Vec<Facet> = faces(a).into_iter().map(facet).collect();
    all.extend(faces(b).into_iter().map(|normal| facet(-normal)));
    let edges_of_b = edges(b);
    for on_a in edges(a) {
        let [p, q] = on_a.normals;
        for on_b in &edges_of_b {
            let [s, t] = on_b.normals.map(|normal| -normal);
            let sides_a = [s.dot(&on_a.along), t.dot(&on_a.along)];
            let sides_b = [p.dot(&on_b.along), q.dot(&on_b.along)];
            let cross = sides_a[0] * sides_a[1] < 0.0 && sides_b[0] * sides_b[1] < 0.0;
            let across = on_a.along.cross(&on_b.along);
            // The arcs themselves cross, not their antipodes.
            let outward = across * across.dot(&(p + q)).signum();
            if cross && outward.dot(&(s + t)) > 0.0 {
                let normal = outward.normalize();
                let height = (on_a.from - on_b.from).dot(&normal);
                all.push(Facet { normal, height });
            }
        }
    }
    all
}

fn hull<'a>(body: &Posed<'a>) -> &'a Hull {
    match body.shape.core() {
        Core::Hull(hull) => hull,
        _ => panic!("only polyhedra have facets"),
    }
}

fn edges(body: &Posed) -> Vec<Edge> {
    let hull = hull(body);
    let sides = || hull.triangles().iter().flat_map(|t| [0, 1, 2].map(|k| (t, k)));
    let vertex = |k: u32| body.frame * hull.vertices()[k as usize];
    let mut all = Vec::new();
    for (triangle, k) in sides() {
        let (from, to) = (triangle.corners[k], triangle.corners[(k + 1) % 3]);
        let beyond = sides().find(|(t, k)| t.corners[*k] == to && t.corners[(k + 1) % 3] == from);
        let (other, _) = beyond.expect("a hull is closed");
        if from < to && other.plane != triangle.plane {
            let normals =
                [triangle, other].map(|t| body.frame * hull.planes()[t.plane as usize].normal);
            let (from, to) = (vertex(from), vertex(to));
            all.push(Edge { from, along: to - from, normals });
        }
    }
    all
}
