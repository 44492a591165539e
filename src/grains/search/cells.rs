//! Linked cells: all pairs of bodies whose bounding spheres are closer than the skin.
//!
//! Bodies of similar size share a grid whose cells are as wide as their reach, so partners are in the same or in touching cells. Sizes that
//! differ by more than a factor of two get separate grids, and each small body searches the grids of the larger ones (hierarchical grid; Ogarko
//! and Luding 2012, DOI 10.1016/j.cpc.2011.12.019). The work thus stays in proportion to the number of bodies.
//!
//! The grids span the bodies of the rank, with the images nearest to the owned ones. A rank thus has cells only for its own part of a periodic
//! axis; they go round the period where its bodies do.

use crate::cell::{Cell, Shear};
use crate::contact::Pair;
use crate::ids::{GlobalId, Slot};
use crate::math::{Vec3, bounds};
use crate::particles::Particles;
use crate::walls;
use std::borrow::Cow;

/// Factor on distances when cells are chosen, for the rounding of positions.
const LEEWAY: f64 = 1.0 + 1e-9;

/// Pairs with at least one owned particle and less than `skin` between bounding spheres [m].
///
/// The other body is an owned particle, a ghost or a plane of a wall. The slots of facets follow those of the ghosts, even if not yet appended.
pub fn close_pairs(particles: &Particles, skin: f64) -> Vec<Pair> {
    let mut pairs = Vec::new();
    let bodies = particles.first_facet();
    if particles.owned > 0 {
        let classes = Classes::of(particles);
        for_each_candidate(particles, &classes, skin, |i, j| {
            if i >= particles.owned && j >= particles.owned {
                return;
            }
            let difference = particles.cell.nearest(particles.position[j] - particles.position[i]);
            let limit = particles.radius(i) + particles.radius(j) + skin;
            if difference.norm_squared() < limit * limit {
                let (a, b) = if particles.id[i] < particles.id[j] { (i, j) } else { (j, i) };
                pairs.push(Pair { a: Slot(a as u32), b: Slot(b as u32) });
            }
        });
    }

    let facets = walls::facets(&particles.walls);
    for slot in 0..particles.owned {
        for (k, facet) in facets.iter().enumerate() {
            if facet.distance(&particles.position[slot]) < particles.radius(slot) + skin {
                pairs.push(Pair { a: Slot(slot as u32), b: Slot((bodies + k) as u32) });
            }
        }
    }
    pairs
}

/// Finds the facets of meshes nearer than `skin` [m] to the bounding sphere of an owned particle, which get slots.
///
/// Returns their pairs, which [`close_pairs`] leaves out.
pub fn note_near_facets(particles: &mut Particles, skin: f64) -> Vec<Pair> {
    let mut near: Vec<(usize, GlobalId)> = Vec::new();
    for (k, wall) in particles.walls.iter().enumerate().filter(|(_, wall)| wall.mesh.is_some()) {
        for slot in 0..particles.owned {
            let reach = particles.radius(slot) + skin;
            // A particle that passes through a period meets other facets at once.
            let places = particles.cell.places_within(&particles.position[slot], skin);
            let mut facets: Vec<u32> =
                places.iter().flat_map(|place| wall.facets_near(place, reach)).collect();
            if places.len() > 1 {
                facets.sort_unstable();
                facets.dedup();
            }
            near.extend(facets.into_iter().map(|facet| (slot, GlobalId::facet(k, facet as usize))));
        }
    }
    let mut ids: Vec<GlobalId> = near.iter().map(|&(_, id)| id).collect();
    ids.sort_unstable();
    ids.dedup();
    let first = particles.first_facet() + walls::facets(&particles.walls).len();
    let pair = |(slot, id): (usize, GlobalId)| {
        let k = ids.partition_point(|other| *other < id);
        Pair { a: Slot(slot as u32), b: Slot((first + k) as u32) }
    };
    let pairs = near.into_iter().map(pair).collect();
    particles.near_facets = ids;
    pairs
}

/// Bodies by size: in each class the largest has at most twice the radius of the smallest.
struct Classes {
    /// Slots of each class; the first class has the largest bodies.
    members: Vec<Vec<u32>>,
    /// Largest bounding radius of each class [m].
    radius: Vec<f64>,
}

impl Classes {
    fn of(particles: &Particles) -> Self {
        if particles.needs.scale { Self::by_size(particles) } else { Self::by_shape(particles) }
    }

    /// Classes from the size of each body.
    fn by_size(particles: &Particles) -> Self {
        let bodies = 0..particles.first_facet();
        let largest = bodies.clone().map(|slot| particles.radius(slot)).fold(0.0, f64::max);
        let mut classes = Self { members: Vec::new(), radius: Vec::new() };
        for slot in bodies {
            let radius = particles.radius(slot);
            let class = (libm::log2(largest / radius) as usize).min(63);
            while classes.members.len() <= class {
                classes.members.push(Vec::new());
                classes.radius.push(0.0);
            }
            classes.members[class].push(slot as u32);
            classes.radius[class] = classes.radius[class].max(radius);
        }
        classes
    }

    /// Classes with all particles of a shape together.
    fn by_shape(particles: &Particles) -> Self {
        let library = &particles.library;
        let mut of_shape = vec![0; library.particle_shapes];
        let mut by_size: Vec<usize> = (0..library.particle_shapes).collect();
        by_size.sort_by(|&a, &b| library.radius[b].total_cmp(&library.radius[a]));
        let mut classes = Self { members: Vec::new(), radius: Vec::new() };
        for shape in by_size {
            let radius = library.radius[shape];
            if classes.radius.last().is_none_or(|&largest| 2.0 * radius <= largest) {
                classes.radius.push(radius);
                classes.members.push(Vec::new());
            }
            of_shape[shape] = classes.radius.len() - 1;
        }
        for (slot, shape) in particles.shape[..particles.first_facet()].iter().enumerate() {
            classes.members[of_shape[shape.index()]].push(slot as u32);
        }
        classes
    }
}

/// Calls `visit` once for every pair of slots that may be as close as `skin` [m].
fn for_each_candidate(
    particles: &Particles,
    classes: &Classes,
    skin: f64,
    mut visit: impl FnMut(usize, usize),
) {
    let bodies = particles.first_facet();
    let (mut cell, mut positions) = (particles.cell, Cow::Borrowed(&particles.position[..bodies]));
    let mut leeway = LEEWAY;
    if let Some(upright) = cell.upright() {
        // A tilted cell is searched in its upright image, with longer distances.
        positions = positions.iter().map(|place| cell.in_upright(place)).collect();
        leeway *= cell.upright_over_distance();
        cell = upright;
    }
    let positions = unfolded(positions, particles.owned, &cell);
    let reach = |a: usize, b: usize| (classes.radius[a] + classes.radius[b] + skin) * leeway;
    let space = Space::around(&positions, &cell, reach(0, 0));
    let across = Across::of(&cell, &positions);
    let mut visit_direct = |i: usize, j: usize| {
        if across.as_ref().is_none_or(|across| !across.is_between(i, j)) {
            visit(i, j);
        }
    };
    // From the largest to the smallest.
    let mut larger: Vec<(usize, Grid)> = Vec::new();
    let some = classes.members.iter().enumerate().filter(|(_, members)| !members.is_empty());
    for (class, members) in some {
        let grid = Grid::new(&space, &positions, members, reach(class, class));
        grid.for_each_candidate(&mut visit_direct);
        for (other, theirs) in &larger {
            let reach = reach(class, *other);
            for &slot in members {
                theirs.for_each_near(&positions[slot as usize], reach, |other| {
                    visit_direct(slot as usize, other);
                });
            }
        }
        larger.push((class, grid));
    }
    let Some(across) = across else { return };
    for (k, (class, grid)) in larger.iter().enumerate() {
        for (other, _) in &larger[k..] {
            // For two bodies of one class, the lower one searches upwards.
            let shifts = if class == other { &[1.0][..] } else { &[1.0, -1.0] };
            for (&slot, &up) in classes.members[*other]
                .iter()
                .flat_map(|slot| shifts.iter().map(move |up| (slot, up)))
            {
                across.for_each_near(slot as usize, up, grid, reach(*class, *other), &mut visit);
            }
        }
    }
}

/// Pairs of bodies across a face with sliding images, where the grids do not go round the period.
struct Across<'a> {
    cell: &'a Cell,
    shear: Shear,
    /// Period across which images slide [m].
    period: f64,
    /// Positions as in the grids [m].
    positions: &'a [Vec3],
}

impl<'a> Across<'a> {
    /// Pairs of a cell with sliding images; `None` if no image slides.
    fn of(cell: &'a Cell, positions: &'a [Vec3]) -> Option<Self> {
        let shear = cell.shear()?;
        Some(Self { cell, shear, period: cell.periods()[shear.across], positions })
    }

    /// Whether a face with sliding images is between two bodies.
    fn is_between(&self, i: usize, j: usize) -> bool {
        let Self { shear: Shear { across, .. }, period, positions, .. } = *self;
        (positions[j][across] - positions[i][across]).abs() > 0.5 * period
    }

    /// Calls `visit` for the bodies of a grid within reach [m] of the image of a body above it, or below.
    fn for_each_near(
        &self,
        slot: usize,
        up: f64,
        grid: &Grid,
        reach: f64,
        visit: &mut impl FnMut(usize, usize),
    ) {
        let Self { cell, shear: Shear { along, across, .. }, period, positions } = *self;
        let Space { low, extent, .. } = grid.space;
        let (bottom, top) = (low[across] - reach, low[across] + extent[across] + reach);
        let mut image = positions[slot];
        image[across] += up * period;
        if !(bottom..=top).contains(&image[across]) {
            return;
        }
        let middle = low + extent * 0.5;
        image[along] += up * cell.slid();
        image[along] = cell.image_along(along, image[along], middle[along]);
        grid.for_each_near(&image, reach, |other| {
            if self.is_between(slot, other) {
                visit(slot, other);
            }
        });
    }
}

/// Positions of the images nearest to the middle of the owned bodies.
fn unfolded<'a>(positions: Cow<'a, [Vec3]>, owned: usize, cell: &Cell) -> Cow<'a, [Vec3]> {
    if !cell.repeats() {
        return positions;
    }
    let (low, high) = bounds(&positions[..owned]);
    let middle = (low + high) * 0.5;
    positions.iter().map(|place| cell.image_near(place, &middle)).collect()
}

/// Box that the grids divide.
struct Space {
    low: Vec3,
    extent: Vec3,
    /// Whether the cells go round the period of each axis.
    wraps: [bool; 3],
}

impl Space {
    fn around(positions: &[Vec3], cell: &Cell, reach: f64) -> Self {
        let (low, high) = bounds(positions);
        let mut extent = high - low;
        // With a spare reach before the period closes, no two images of a body are within reach. A sliding image may be on either side
        // and needs a reach on both.
        let mut wraps = [false; 3];
        let shear = cell.shear();
        for axis in (0..3).filter(|&axis| shear.is_none_or(|shear| shear.across != axis)) {
            let is_along = shear.is_some_and(|shear| shear.along == axis);
            let spare = if is_along { 2.0 * reach } else { reach };
            let period = cell.periods()[axis];
            if extent[axis] + spare > period {
                wraps[axis] = true;
                extent[axis] = period;
            }
        }
        Self { low, extent, wraps }
    }
}

/// A grid of cells with the bodies of one class.
struct Grid<'a> {
    space: &'a Space,
    width: Vec3,
    count: [usize; 3],
    /// Slots by cell; those of cell `c` are `slots[first[c]..first[c + 1]]`.
    first: Vec<u32>,
    slots: Vec<u32>,
    /// Positions of the bodies of these slots [m].
    places: Vec<Vec3>,
    /// Largest distance of two bodies, in a cell or in neighbouring ones, that touch or are listed [m].
    reach: f64,
}

impl<'a> Grid<'a> {
    fn new(space: &'a Space, positions: &[Vec3], members: &[u32], reach: f64) -> Self {
        let mut count = grid_counts(&space.extent, reach, members.len());
        let mut width = space.extent;
        for axis in 0..3 {
            if space.wraps[axis] && count[axis] < 3 {
                // With two cells round the period, each would be both neighbours of the other.
                count[axis] = 1;
            }
            width[axis] = match count[axis] {
                1 => f64::INFINITY,
                count => space.extent[axis] / count as f64,
            };
        }
        let (first, slots, places) = (Vec::new(), Vec::new(), Vec::new());
        let mut grid = Self { space, width, count, first, slots, places, reach };
        let cells: Vec<u32> = members
            .iter()
            .map(|&slot| grid.index(grid.cell(&positions[slot as usize])) as u32)
            .collect();
        let mut first = vec![0u32; count.iter().product::<usize>() + 1];
        for &cell in &cells {
            first[cell as usize + 1] += 1;
        }
        for cell in 1..first.len() {
            first[cell] += first[cell - 1];
        }
        let mut next = first.clone();
        grid.slots.resize(members.len(), 0);
        for (&slot, &cell) in members.iter().zip(&cells) {
            let next = &mut next[cell as usize];
            grid.slots[*next as usize] = slot;
            *next += 1;
        }
        grid.first = first;
        grid.places = grid.slots.iter().map(|&slot| positions[slot as usize]).collect();
        // With one cell round the period, a body is in the same cell as its images: that axis gives no distance.
        for axis in (0..3).filter(|&axis| space.wraps[axis] && count[axis] == 1) {
            grid.places.iter_mut().for_each(|place| place[axis] = 0.0);
        }
        grid
    }

    fn cell(&self, position: &Vec3) -> [usize; 3] {
        [0, 1, 2].map(|axis| {
            let cells = (position[axis] - self.space.low[axis]) / self.width[axis];
            // Positions are outside only by rounding.
            (cells as usize).min(self.count[axis] - 1)
        })
    }

    const fn index(&self, cell: [usize; 3]) -> usize {
        (cell[2] * self.count[1] + cell[1]) * self.count[0] + cell[0]
    }

    fn slots_in(&self, cell: usize) -> &[u32] {
        &self.slots[self.bodies_in(cell)]
    }

    /// Range of the bodies of a cell among those of the grid.
    fn bodies_in(&self, cell: usize) -> std::ops::Range<usize> {
        self.first[cell] as usize..self.first[cell + 1] as usize
    }

    /// Cell at `offset` along an axis, if there is one, and the shift of its bodies.
    ///
    /// The shift is a period where the way goes round the period, and zero elsewhere [m].
    fn neighbour(&self, axis: usize, cell: usize, offset: isize) -> Option<(usize, f64)> {
        let count = self.count[axis] as isize;
        let there = cell as isize + offset;
        if (0..count).contains(&there) {
            Some((there as usize, 0.0))
        } else if self.space.wraps[axis] && count > 1 {
            let shift = self.space.extent[axis].copysign(offset as f64);
            Some((there.rem_euclid(count) as usize, shift))
        } else {
            None
        }
    }

    /// Calls `visit` once for every pair of slots within reach in the same cell or in touching ones.
    fn for_each_candidate(&self, visit: &mut impl FnMut(usize, usize)) {
        // Wider by far more than rounding, and by far less than a skin.
        let limit = (self.reach * (1.0 + 1e-6)).powi(2);
        let mut look = |k: usize, m: usize, shift: &Vec3| {
            let apart = self.places[m] + shift - self.places[k];
            if apart.norm_squared() <= limit {
                visit(self.slots[k] as usize, self.slots[m] as usize);
            }
        };
        for z in 0..self.count[2] {
            for y in 0..self.count[1] {
                for x in 0..self.count[0] {
                    let here = self.bodies_in(self.index([x, y, z]));
                    if here.is_empty() {
                        continue;
                    }
                    for k in here.clone() {
                        for m in k + 1..here.end {
                            look(k, m, &Vec3::zeros());
                        }
                    }
                    for [dx, dy, dz] in HALF_OF_NEIGHBOURS {
                        let (Some((x, to_x)), Some((y, to_y)), Some((z, to_z))) = (
                            self.neighbour(0, x, dx),
                            self.neighbour(1, y, dy),
                            self.neighbour(2, z, dz),
                        ) else {
                            continue;
                        };
                        let shift = Vec3::new(to_x, to_y, to_z);
                        for m in self.bodies_in(self.index([x, y, z])) {
                            for k in here.clone() {
                                look(k, m, &shift);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Calls `visit` for every slot in the cells that come within `reach` [m] of a position along all axes.
    fn for_each_near(&self, position: &Vec3, reach: f64, mut visit: impl FnMut(usize)) {
        let [along_x, along_y, along_z] =
            [0, 1, 2].map(|axis| self.cells_within(axis, position[axis], reach));
        for z in along_z {
            let z = z % self.count[2];
            for y in along_y.clone() {
                let y = y % self.count[1];
                for x in along_x.clone() {
                    for &slot in self.slots_in(self.index([x % self.count[0], y, z])) {
                        visit(slot as usize);
                    }
                }
            }
        }
    }

    /// Cells along an axis within `reach` of a place, to be taken modulo their number.
    fn cells_within(&self, axis: usize, place: f64, reach: f64) -> std::ops::Range<usize> {
        let count = self.count[axis] as isize;
        let cell =
            |place: f64| ((place - self.space.low[axis]) / self.width[axis]).floor() as isize;
        let (lowest, highest) = (cell(place - reach), cell(place + reach));
        if !self.space.wraps[axis] {
            let within = |cell: isize| cell.clamp(0, count - 1) as usize;
            within(lowest)..within(highest) + 1
        } else if highest - lowest + 1 >= count {
            0..self.count[axis]
        } else {
            let first = lowest.rem_euclid(count);
            first as usize..(first + highest - lowest + 1) as usize
        }
    }
}

/// Number of cells along each side of a box, none narrower than `reach`.
///
/// Together they are at most in proportion to the bodies, so that a sparse cloud costs no more than a packing.
fn grid_counts(extent: &Vec3, reach: f64, bodies: usize) -> [usize; 3] {
    let most = 4.0 * bodies as f64 + 64.0;
    let mut width = reach;
    loop {
        let count = extent.map(|side| (side / width).floor().max(1.0));
        let all = count.product();
        if all <= most {
            return [0, 1, 2].map(|axis| count[axis] as usize);
        }
        width *= libm::cbrt(all / most).max(1.01);
    }
}

/// One of each two opposite neighbours of a cell.
const HALF_OF_NEIGHBOURS: [[isize; 3]; 13] = [
    [1, 0, 0],
    [-1, 1, 0],
    [0, 1, 0],
    [1, 1, 0],
    [-1, -1, 1],
    [0, -1, 1],
    [1, -1, 1],
    [-1, 0, 1],
    [0, 0, 1],
    [1, 0, 1],
    [-1, 1, 1],
    [0, 1, 1],
    [1, 1, 1],
];

#[cfg(test)]
mod tests {
    use super::close_pairs;
    use crate::cell::{Cell, Shear, Strained};
    use crate::ids::{GlobalId, MaterialId, ShapeId, Standing};
    use crate::math::{Mat3, Vec3};
    use crate::particles::records::Particle;
    use crate::particles::{Needs, Particles};
    use crate::population::Library;
    use crate::random::Random;
    use crate::shape::{Shape, Sphere};
    use std::collections::BTreeSet;

    /// A sequence that fills the unit cube evenly (Roberts' R3), for positions without a generator.
    fn point(i: usize) -> Vec3 {
        let i = i as f64;
        Vec3::new((i * 0.819_172_5).fract(), (i * 0.671_043_6).fract(), (i * 0.549_700_5).fract())
    }

    /// Spheres of these radii at the points. Spheres in the lower `share` of x are owned, the rest ghosts.
    ///
    /// Each size is a shape of its own or, if `sized`, a scale of the first.
    fn spheres(
        radii: &[f64],
        positions: &[Vec3],
        cell: &Cell,
        share: f64,
        sized: bool,
    ) -> Particles {
        let mut library = Library::default();
        for &radius in if sized { &radii[..1] } else { radii } {
            library.push("sphere", Shape::Sphere(Sphere { radius }), MaterialId(0), 1.0);
        }
        library.particle_shapes = library.shapes.len();
        if sized {
            for radius in radii {
                library.admit(ShapeId(0), radius / radii[0]);
            }
        }
        let needs = Needs { scale: sized, ..Needs::default() };
        let mut particles = Particles::new(needs, library, Vec::new(), *cell);
        let width = positions.iter().map(|p| p.x).fold(0.0, f64::max);
        let mut ghosts = Vec::new();
        for (k, &position) in positions.iter().enumerate() {
            // Larger spheres are rarer.
            let size = (0..radii.len() - 1).find(|&n| k % (4 << n) != 0).unwrap_or(radii.len() - 1);
            let (id, shape) = (GlobalId(k as u64), ShapeId(if sized { 0 } else { size as u16 }));
            let scale = if sized { radii[size] / radii[0] } else { 1.0 };
            if position.x <= share * width {
                let particle = Particle { scale, ..Particle::at_rest(id, shape, position) };
                particles.push_owned(&particle);
            } else {
                ghosts.push((id, shape, scale, position));
            }
        }
        let names: Vec<_> =
            ghosts.iter().map(|&(id, shape, ..)| (id, shape, Standing(id.0))).collect();
        let scales: Vec<_> = ghosts.iter().map(|&(.., scale, _)| scale).collect();
        particles.push_ghosts(&names, if sized { &scales } else { &[] });
        for (k, (.., position)) in ghosts.into_iter().enumerate() {
            particles.position[particles.owned + k] = position;
        }
        particles
    }

    #[test]
    fn cells_find_what_brute_force_finds() {
        let mut all = 0;
        let slid = |along, across, strain| Some(Shear { along, across, rate: 0.0, strain });
        let leans = |x: f64, y: f64, z: f64, [xy, xz, yz]: [f64; 3]| {
            let edges = Mat3::new(x, xy, xz, 0.0, y, yz, 0.0, 0.0, z);
            Strained { edges, rate: Mat3::zeros(), strain: Mat3::zeros() }
        };
        let strained = [
            leans(1.0, 0.5, 2.0, [0.49, -0.3, 0.2]),
            leans(0.5, 1.0, 1.0, [7.9, 3.2, -2.6]),
            leans(0.6, 0.6, 0.7, [-0.3, 0.3, 0.3]),
        ];
        let boxes = strained.map(|strained| (strained.edges.diagonal(), [true; 3], None));
        let leaning = boxes.into_iter().zip(strained.map(Some));
        let upright = [
            (Vec3::repeat(1.0), [false; 3], None),
            (Vec3::new(1.0, 1.0, 0.5), [true, false, true], None),
            (Vec3::new(1.0, 0.5, 2.0), [true; 3], None),
            (Vec3::new(0.25, 1.0, 1.0), [true; 3], None),
            (Vec3::new(1.0, 0.5, 2.0), [true; 3], slid(2, 0, 0.3)),
            (Vec3::new(0.25, 1.0, 1.0), [true; 3], slid(0, 1, 7.41)),
            (Vec3::new(1.0, 0.7, 0.5), [true, false, true], slid(0, 2, -0.49)),
        ];
        let upright = upright.map(|one| (one, None)).into_iter();
        for ((high, periodic, shear), strained) in upright.chain(leaning) {
            let mut cell = Cell::new(Vec3::zeros(), high, periodic);
            if let Some(shear) = shear {
                cell = cell.with_shear(shear).expect("both axes repeat");
            }
            if let Some(strained) = strained {
                cell = cell.with_strain(strained).expect("all axes repeat");
            }
            for radii in [&[0.05][..], &[0.06], &[0.003, 0.06], &[0.003, 0.004, 0.011, 0.024, 0.06]]
            {
                for (share, sized) in [(0.3, false), (0.7, false), (1.0, false), (0.7, true)] {
                    let positions: Vec<_> =
                        (0..600).map(|i| point(i).component_mul(&high)).collect();
                    let particles = spheres(radii, &positions, &cell, share, sized);
                    let skin = 0.004;
                    let mut found = BTreeSet::new();
                    for pair in close_pairs(&particles, skin) {
                        let (i, j) = (pair.a.index(), pair.b.index());
                        assert!(found.insert((i.min(j), i.max(j))), "pair {i}, {j} twice");
                    }
                    let close = |i: usize, j: usize| {
                        let apart = particles.position[j] - particles.position[i];
                        let reach = particles.radius(i) + particles.radius(j) + skin;
                        cell.nearest(apart).norm_squared() < reach * reach
                    };
                    let expected: BTreeSet<_> = (0..positions.len())
                        .flat_map(|j| (0..j.min(particles.owned)).map(move |i| (i, j)))
                        .filter(|&(i, j)| close(i, j))
                        .collect();
                    all += expected.len();
                    assert_eq!(found, expected, "{cell:?}, radii {radii:?}, {share} owned");
                }
            }
        }
        assert!(all > 1000, "{all} pairs");
    }

    /// A few bodies that leave most of the period along the flow empty.
    #[test]
    fn few_bodies_meet_across_a_face_that_slides() {
        let (high, skin) = (Vec3::repeat(10.0), 0.05);
        let (mut all, mut seed) = (0, 0);
        let mut check = |positions: &[Vec3], slid: f64| {
            let shear = Shear { along: 0, across: 1, rate: 0.0, strain: 0.1 * slid };
            let cell = Cell::new(Vec3::zeros(), high, [true; 3]).with_shear(shear).unwrap();
            let particles = spheres(&[0.5], positions, &cell, 1.0, false);
            let found: BTreeSet<_> = close_pairs(&particles, skin)
                .iter()
                .map(|pair| {
                    (pair.a.index().min(pair.b.index()), pair.a.index().max(pair.b.index()))
                })
                .collect();
            let close = |&(i, j): &(usize, usize)| {
                let apart = particles.position[j] - particles.position[i];
                cell.nearest(apart).norm() < 1.0 + skin
            };
            let count = positions.len();
            let expected: BTreeSet<_> =
                (0..count).flat_map(|j| (0..j).map(move |i| (i, j))).filter(close).collect();
            assert_eq!(found, expected, "slid {slid}: {positions:?}");
            all += found.len();
        };
        check(&[Vec3::new(1.2, 9.8, 5.0), Vec3::new(9.7, 0.1, 5.0)], 0.7);
        for count in 2..9 {
            for _ in 0..2000 {
                seed += 1;
                let mut random = Random::of(seed, 0);
                let places: Vec<Vec3> = (0..count)
                    .map(|_| {
                        let y = random.signed();
                        let y = if y < 0.0 { y + 10.0 } else { y };
                        Vec3::new(10.0 * random.unit(), y, 5.0 + 0.4 * random.signed())
                    })
                    .collect();
                check(&places, 5.0 * random.signed());
            }
        }
        assert!(all > 1000, "{all} pairs");
    }
}
