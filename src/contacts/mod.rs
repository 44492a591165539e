//! Contacts of a rank: the touching pairs, their state and their forces.
//!
//! They stand in the order of the list of pairs, in columns for each stretch of it. A step goes through the stretches.
//! Resolvers find the touching pairs. [`Contacts::arrange`] orders them beside the state of the last step. In
//! [`Contacts::compute_forces`] a law finds the forces, and the new columns replace the old.

mod passing;
mod pieces;
mod surfaces;
mod visiting;

use crate::contact::curvature::{self, Curvature};
use crate::contact::{
    Batch, ContactRecord, ContactRecords, Found, Geometry, Pair, Patch, Previous, StateColumn,
    Touch, Touching, across_gap, touch_of_sphere,
};
use crate::ids::{GlobalId, Slot};
use crate::lanes::prefetch;
use crate::law::kernel::CONTACT_POINT;
use crate::law::{ForceLaw, Last, Separated, Sums, Work};
use crate::math::Vec3;
use crate::particles::{Needs, Particles, held};
use crate::search::{PairList, in_order};
use std::collections::HashMap;
pub use visiting::{Visited, Visitor};

/// Bytes of a contact in the columns that every scene needs: bodies, number, geometry, force.
pub const CONTACT_COLUMNS: usize =
    size_of::<Pair>() + size_of::<u32>() + size_of::<Geometry>() + size_of::<Vec3>();

/// Contacts in the order of their pairs. Columns that a scene does not need are empty.
#[derive(Clone, Debug, Default)]
struct Columns {
    /// Bodies.
    pairs: Vec<Pair>,
    /// Numbers in the stretch.
    numbers: Vec<u32>,
    /// Normals and overlaps.
    geometry: Vec<Geometry>,
    /// State of the law: as many values for each contact as the law declares.
    state: Vec<f64>,
    /// Forces of A on B [N]; empty until they are found.
    forces: Vec<Vec3>,
    /// Contact points from the centres of A [m]; empty if all particles are spheres.
    points: Vec<Vec3>,
    /// Further geometry of contacts of faces; empty if no body has faces.
    patches: Vec<Patch>,
}

impl Columns {
    /// Empties the columns of touching pairs. Forces and state stay, because a law overwrites them.
    fn clear(&mut self) {
        self.pairs.clear();
        self.numbers.clear();
        self.geometry.clear();
        self.points.clear();
        self.patches.clear();
    }

    /// Reserves room for this number of contacts and few more, because growing would double it.
    fn reserve(&mut self, count: usize, width: usize, needs: Needs) {
        reserve(&mut self.pairs, count);
        reserve(&mut self.forces, count);
        reserve(&mut self.state, count * width);
        self.reserve_touching(count, needs);
    }

    /// Replaces the columns of touching pairs by empty ones with room. The others keep their room and content, because a
    /// law overwrites it.
    fn renew_touching(&mut self, count: usize, needs: Needs) {
        let Self { pairs, state, forces, .. } = std::mem::take(self);
        *self = Self { pairs, state, forces, ..Self::default() };
        self.reserve_touching(count, needs);
    }

    fn reserve_touching(&mut self, count: usize, needs: Needs) {
        let Self { numbers, geometry, points, patches, .. } = self;
        reserve(numbers, count);
        reserve(geometry, count);
        if needs.orientation {
            reserve(points, count);
        }
        if needs.patches {
            reserve(patches, count);
        }
    }

    /// Swaps the columns of touching pairs with `touching`.
    fn swap(&mut self, touching: &mut Touching) {
        std::mem::swap(&mut self.numbers, &mut touching.pair);
        std::mem::swap(&mut self.geometry, &mut touching.geometry);
        std::mem::swap(&mut self.points, &mut touching.point);
        std::mem::swap(&mut self.patches, &mut touching.patch);
    }

    /// Resizes forces and state to the number of contacts.
    fn make_places(&mut self, width: usize) {
        let count = self.pairs.len();
        resize(&mut self.forces, count, Vec3::zeros());
        resize(&mut self.state, count * width, 0.0);
    }

    /// Frees the room of grown columns beyond their content.
    fn shrink(&mut self) {
        let Self { pairs, numbers, geometry, state, forces, points, patches } = self;
        pairs.shrink_to_fit();
        numbers.shrink_to_fit();
        geometry.shrink_to_fit();
        state.shrink_to_fit();
        forces.shrink_to_fit();
        points.shrink_to_fit();
        patches.shrink_to_fit();
    }

    /// State values of a contact.
    fn state(&self, place: usize) -> &[f64] {
        let width = self.state.len() / self.pairs.len();
        &self.state[place * width..][..width]
    }

    /// Normal force of a contact [N].
    fn normal_force(&self, place: usize, law: &dyn ForceLaw, particles: &Particles) -> f64 {
        law.normal_force(self.pairs[place], particles, &self.geometry[place], self.state(place))
    }

    /// Contact point from the centre of A [m].
    fn point(&self, place: usize, particles: &Particles) -> Vec3 {
        let Geometry { normal, overlap } = &self.geometry[place];
        let radius = || particles.radius(self.pairs[place].a.index());
        self.points
            .get(place)
            .copied()
            .unwrap_or_else(|| touch_of_sphere(radius(), normal, *overlap))
    }

    fn loaded<'a>(
        &'a self,
        law: &'a dyn ForceLaw,
        particles: &'a Particles,
    ) -> impl Iterator<Item = Loaded<'a>> {
        self.forces.iter().enumerate().map(move |(place, &force)| Loaded {
            pair: self.pairs[place],
            geometry: &self.geometry[place],
            state: self.state(place),
            normal_force: self.normal_force(place, law, particles),
            force,
            point: self.point(place, particles),
            patch: self.patches.get(place),
        })
    }

    fn bytes(&self) -> usize {
        let Self { pairs, numbers, geometry, state, forces, points, patches } = self;
        held(pairs)
            + held(numbers)
            + held(geometry)
            + held(state)
            + held(forces)
            + held(points)
            + held(patches)
    }
}

/// Slots by the ids of their bodies.
struct SlotsById {
    /// Lowest id.
    first: u64,
    /// Slots of the ids from there on, up to a range where they are dense; [`Self::NONE`] for ids without a slot.
    dense: Vec<u32>,
    others: HashMap<GlobalId, u32>,
}

impl SlotsById {
    const NONE: u32 = u32::MAX;
    /// Largest range per id: a hash map takes as much room.
    const WIDEST: usize = 8;

    fn of(ids: &[GlobalId]) -> Self {
        let first = ids.iter().min().map_or(0, |id| id.0);
        let highest = ids.iter().filter(|id| id.wall_index().is_none()).max();
        let range = highest.map_or(0, |id| (id.0 - first) as usize + 1);
        let dense = vec![Self::NONE; range.min(Self::WIDEST * ids.len())];
        let mut slots = Self { first, dense, others: HashMap::new() };
        for (id, slot) in ids.iter().zip(0..) {
            match slots.dense.get_mut((id.0 - first) as usize) {
                Some(place) => *place = slot,
                None => {
                    slots.others.insert(*id, slot);
                }
            }
        }
        slots
    }

    fn get(&self, id: GlobalId) -> Option<Slot> {
        let place = id.0.checked_sub(self.first)?;
        let slot = self.dense.get(place as usize).or_else(|| self.others.get(&id));
        slot.copied().filter(|&slot| slot != Self::NONE).map(Slot)
    }
}

/// Reserves room for this number of entries of an empty column, and a few more.
fn reserve<T>(column: &mut Vec<T>, count: usize) {
    column.reserve_exact(count + count / 32);
}

/// Sets the length, in the present room unless that is too small or far too large; the content will be overwritten.
fn resize<T: Clone>(column: &mut Vec<T>, length: usize, value: T) {
    if !(length..=length + length / 4 + 64).contains(&column.capacity()) {
        *column = Vec::new();
        reserve(column, length);
    }
    column.resize(length, value);
}

/// Is there room for this number of contacts, and not for many more?
fn fits(columns: &Columns, count: usize) -> bool {
    (count..=count + count / 8 + 4).contains(&columns.numbers.capacity())
}

/// Number of spare columns that are kept for stretches of other lengths.
const SPARE: usize = 3;

/// Empty columns with room for this number of contacts and not many more.
fn room(spare: &mut Vec<Columns>, count: usize, width: usize, needs: Needs) -> Columns {
    if let Some(place) = spare.iter().position(|columns| fits(columns, count)) {
        let mut columns = spare.swap_remove(place);
        columns.clear();
        return columns;
    }
    if spare.len() >= SPARE {
        spare.remove(0);
    }
    let mut columns = Columns::default();
    columns.reserve(count, width, needs);
    columns
}

/// A contact with its force and state.
#[derive(Clone, Copy, Debug)]
pub struct Loaded<'a> {
    /// Bodies.
    pub pair: Pair,
    /// Normal and overlap.
    pub geometry: &'a Geometry,
    /// State values, see [`ForceLaw::state`].
    pub state: &'a [f64],
    /// Normal force [N].
    pub normal_force: f64,
    /// Force of A on B [N]; A feels the opposite.
    pub force: Vec3,
    /// Contact point from the centre of A [m].
    pub point: Vec3,
    /// Further geometry of a contact with an extent.
    pub patch: Option<&'a Patch>,
}

/// Touching contacts of a rank.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// State columns of the law.
    remembered: Vec<StateColumn>,
    /// Number of values in these columns.
    width: usize,
    /// Contacts of each stretch of the list of pairs.
    stretches: Vec<Columns>,
    /// Present contacts of the stretch in work.
    now: Columns,
    /// Spare columns from stretches of the last step.
    spare: Vec<Columns>,
    /// For each pair of the stretch in work, its contact of the last step.
    previous: Vec<Previous>,
    /// For each pair of the stretch in work, its place in the results of resolvers.
    found: Vec<u32>,
    /// Places in the results, in the order of the pairs.
    order: Vec<u32>,
    /// Place of each contact in work at the last step; empty if the same pairs touch.
    from: Vec<Previous>,
    separated: Vec<Separated>,
    /// Curvature of the bodies of the contacts in work; empty if the law does not use it.
    curvatures: Vec<Curvature>,
    /// Share of the masses of their bodies for the contacts in work; empty without pieces of unions.
    shares: Vec<f64>,
}

impl Contacts {
    /// No contacts, with these state columns of the law.
    pub fn of(remembered: &[StateColumn]) -> Self {
        let width = StateColumn::total_width(remembered);
        Self { remembered: remembered.to_vec(), width, ..Self::default() }
    }

    /// State columns of the law.
    pub fn remembered(&self) -> &[StateColumn] {
        &self.remembered
    }

    /// Transfers the state to a new list of pairs, for bodies with these places in the spatial order. `carried` has the
    /// records of all touching contacts of owned particles, in any order; a contact may appear twice.
    pub fn rebuild(
        &mut self,
        list: &PairList,
        particles: &Particles,
        places: &[u32],
        carried: &ContactRecords,
    ) {
        // Both have the same order; walls have the last places.
        let key = |pair: Pair| (pair.b.index() >= particles.first_facet(), in_order(pair, places));
        let slots = SlotsById::of(&particles.id);
        let named = |row: u32| {
            let (a, b) = carried.ends(row as usize);
            Some((key(Pair { a: slots.get(a)?, b: slots.get(b)? }), row))
        };
        let mut rows: Vec<_> = (0..carried.len() as u32).filter_map(named).collect();
        rows.sort_unstable();
        self.stretches.clear();
        self.now = Columns::default();
        self.spare.clear();
        let mut rest = &*rows;
        for stretch in &list.stretches {
            let mut columns = Columns::default();
            for (pair, number) in list.pairs[stretch.range.clone()].iter().zip(0..) {
                let here = key(*pair);
                while rest.first().is_some_and(|(key, _)| *key < here) {
                    rest = &rest[1..];
                }
                let Some(&(_, row)) = rest.first().filter(|(key, _)| *key == here) else {
                    continue;
                };
                let ContactRecord { geometry, state, .. } = carried.get(row as usize);
                columns.pairs.push(*pair);
                columns.numbers.push(number);
                columns.geometry.push(geometry);
                columns.state.extend_from_slice(state);
            }
            columns.shrink();
            self.stretches.push(columns);
        }
    }

    /// Prefetches the state of a stretch.
    pub fn prefetch(&self, stretch: usize) {
        let Columns { pairs, numbers, geometry, state, .. } = &self.stretches[stretch];
        prefetch(pairs);
        prefetch(numbers);
        prefetch(geometry);
        prefetch(state);
    }

    /// Prepares a stretch for resolvers: room for touching pairs, and for shapes other than spheres the place of each pair
    /// at the last step.
    pub fn prepare(
        &mut self,
        stretch: usize,
        length: usize,
        touching: &mut Touching,
        needs: Needs,
    ) {
        let before = self.stretches[stretch].numbers.len();
        self.now = room(&mut self.spare, before, self.width, needs);
        self.now.swap(touching);
        self.previous.clear();
        if !needs.orientation {
            // For spheres the last normal is not used.
            return;
        }
        self.previous.resize(length, Previous::NONE);
        for (place, &number) in self.stretches[stretch].numbers.iter().enumerate() {
            self.previous[number as usize] = Previous::at(place);
        }
    }

    /// Pairs of the stretch, in the form that resolvers use.
    pub fn batch<'a>(
        &'a self,
        stretch: usize,
        pairs: &'a [Pair],
        active: &'a [u32],
        particles: &'a Particles,
    ) -> Batch<'a> {
        let geometry = &self.stretches[stretch].geometry;
        Batch { pairs, previous: &self.previous, geometry, active, bodies: particles.bodies() }
    }

    /// Keeps contacts that outlive their overlap: those of the last step whose gap is below [`ForceLaw::outlives`]. They
    /// have a negative overlap, and their pairs do not rest.
    pub fn keep_outliving(
        &self,
        stretch: usize,
        pairs: &[Pair],
        found: &mut Found,
        law: &dyn ForceLaw,
        particles: &Particles,
    ) {
        let before = &self.stretches[stretch].numbers;
        let Found { contacts, apart, .. } = found;
        apart.retain(|&(number, clearance)| {
            let pair = pairs[number as usize];
            let lasts =
                before.binary_search(&number).is_ok() && clearance < law.outlives(pair, particles);
            if lasts {
                contacts.push(number, &across_gap(&particles.bodies(), pair, clearance));
            }
            !lasts
        });
    }

    /// Orders the touching pairs of a stretch like its pairs, beside their state of the last step. If the same pairs touch
    /// as before, they stay where they are until [`Contacts::compute_forces`] takes them over.
    pub fn arrange(
        &mut self,
        stretch: usize,
        pairs: &[Pair],
        touching: &mut Touching,
        particles: &Particles,
    ) {
        let on_meshes = surfaces::has_meshes(pairs, particles);
        if on_meshes || surfaces::has_equal_planes(pairs, particles) {
            surfaces::merge(touching, pairs, particles);
        }
        let with_pieces = pieces::are_there(pairs, particles);
        if with_pieces {
            pieces::merge(touching, pairs, particles);
        }
        // Usually the same pairs touch and were found in order: then no further check is needed.
        let are_same = touching.pair == self.stretches[stretch].numbers;
        if are_same || touching.pair.is_sorted() {
            self.now.swap(touching);
        } else {
            self.sort(pairs.len(), touching, particles.needs);
        }
        let Self { stretches, now, from, separated, .. } = self;
        if !fits(now, now.numbers.len()) {
            now.shrink();
        }
        from.clear();
        separated.clear();
        let before = &stretches[stretch];
        if are_same || now.numbers == before.numbers {
            return;
        }
        now.pairs.extend(now.numbers.iter().map(|&pair| pairs[pair as usize]));
        let mut rest = before.numbers.iter().zip(0..).peekable();
        for &number in &now.numbers {
            while let Some((_, place)) = rest.next_if(|&(&other, _)| other < number) {
                separated.push(Separated { place, before: from.len() });
            }
            let same = rest.next_if(|&(&other, _)| other == number);
            from.push(same.map_or(Previous::NONE, |(_, place)| Previous::at(place)));
        }
        separated.extend(rest.map(|(_, place)| Separated { place, before: from.len() }));
        if on_meshes || with_pieces {
            let (now, last) = ((&*now.pairs, &*now.geometry), (&*before.pairs, &*before.geometry));
            passing::pass_on(now, last, from, separated, particles);
        }
        if with_pieces {
            self.see_from_new_pieces(stretch, particles);
        }
    }

    /// Gives remembered contact points from the piece that has the contact now.
    fn see_from_new_pieces(&mut self, stretch: usize, particles: &Particles) {
        let Self { stretches, now, from, remembered, width, .. } = self;
        let mut columns = StateColumn::ranges(remembered);
        let Some((_, point)) = columns.find(|(column, _)| column.name == CONTACT_POINT.name) else {
            return;
        };
        let before = &mut stretches[stretch];
        for (pair, from) in now.pairs.iter().zip(from).filter(|(_, from)| **from != Previous::NONE)
        {
            let place = from.index();
            let last = before.pairs[place].a;
            if last != pair.a {
                let moved = particles.position[last.index()] - particles.position[pair.a.index()];
                let numbers = &mut before.state[place * *width..][point.clone()];
                numbers.iter_mut().zip(&moved).for_each(|(number, moved)| *number += moved);
            }
        }
    }

    /// Orders touching pairs by the `length` pairs of the stretch.
    fn sort(&mut self, length: usize, touching: &Touching, needs: Needs) {
        let Self { found, order, now, .. } = self;
        if !fits(now, touching.len()) {
            now.renew_touching(touching.len(), needs);
        }
        found.clear();
        found.resize(length, u32::MAX);
        for (&pair, place) in touching.pair.iter().zip(0..) {
            found[pair as usize] = place;
        }
        // Every place is written, and overwritten by the next one if the pair does not touch: no branch to mispredict.
        order.clear();
        order.resize(length + 1, 0);
        let mut count = 0;
        for &place in &*found {
            order[count] = place;
            count += usize::from(place != u32::MAX);
        }
        let order = &order[..count];
        now.numbers.extend(order.iter().map(|&place| touching.pair[place as usize]));
        now.geometry.extend(order.iter().map(|&place| touching.geometry[place as usize]));
        if !touching.point.is_empty() {
            now.points.extend(order.iter().map(|&place| touching.point[place as usize]));
        }
        if !touching.patch.is_empty() {
            now.patches.extend(order.iter().map(|&place| touching.patch[place as usize]));
        }
    }

    /// Lets `law` find the forces of the arranged contacts, and replaces the contacts of the last step by them.
    pub fn compute_forces(
        &mut self,
        stretch: usize,
        law: &dyn ForceLaw,
        particles: &Particles,
        dt: f64,
        sums: &mut Sums,
    ) {
        let Self { stretches, now, spare, from, separated, width, curvatures, shares, .. } = self;
        let before = &mut stretches[stretch];
        if from.is_empty() && separated.is_empty() {
            // Pairs are unchanged, and the old columns are not needed again.
            std::mem::swap(&mut now.pairs, &mut before.pairs);
        }
        now.make_places(*width);
        if particles.needs.curvature {
            curvature::find(&particles.bodies(), &now.pairs, &now.geometry, curvatures);
        }
        pieces::shares((&now.pairs, &now.geometry, &now.patches), particles, shares);
        let mut work = Work {
            pairs: &now.pairs,
            shares,
            geometry: &now.geometry,
            points: &now.points,
            patches: &now.patches,
            curvatures,
            from,
            last: Last { pairs: &before.pairs, geometry: &before.geometry, state: &before.state },
            separated,
            state: &mut now.state,
            forces: &mut now.forces,
        };
        law.apply(&mut work, particles, dt, sums);
        spare.push(std::mem::replace(&mut stretches[stretch], std::mem::take(now)));
    }

    /// Arranged contacts that did not touch at the last step.
    pub fn new_touches<'a>(
        &'a self,
        particles: &'a Particles,
    ) -> impl Iterator<Item = (Pair, Touch)> + 'a {
        let now = &self.now;
        let new = self.from.iter().enumerate().filter(|(_, from)| **from == Previous::NONE);
        new.map(move |(place, _)| {
            let Geometry { normal, overlap } = now.geometry[place];
            let point = now.point(place, particles);
            (now.pairs[place], Touch { overlap, normal, point })
        })
    }

    /// Contacts whose forces have been found, in the order of pairs; those with walls come last.
    pub fn loaded<'a>(
        &'a self,
        law: &'a dyn ForceLaw,
        particles: &'a Particles,
    ) -> impl Iterator<Item = Loaded<'a>> {
        self.stretches.iter().flat_map(move |columns| columns.loaded(law, particles))
    }

    /// Contacts with walls: bodies, geometry and normal force [N]. Also known after a restart, before any force has been
    /// found.
    pub fn pressing_on_walls<'a>(
        &'a self,
        law: &'a dyn ForceLaw,
        particles: &'a Particles,
    ) -> impl Iterator<Item = (Pair, &'a Geometry, f64)> {
        self.with_walls(particles).flat_map(move |columns| {
            columns.pairs.iter().enumerate().map(move |(place, &pair)| {
                let normal_force = columns.normal_force(place, law, particles);
                (pair, &columns.geometry[place], normal_force)
            })
        })
    }

    /// Contacts with walls, with the force on the wall [N], once forces have been found.
    pub fn forces_on_walls<'a>(
        &'a self,
        particles: &'a Particles,
    ) -> impl Iterator<Item = (Pair, &'a Vec3)> {
        let columns = self.with_walls(particles);
        columns.flat_map(|columns| columns.pairs.iter().copied().zip(&columns.forces))
    }

    /// Contacts with walls, with their normals and overlaps.
    pub fn on_walls<'a>(
        &'a self,
        particles: &'a Particles,
    ) -> impl Iterator<Item = (Pair, &'a Geometry)> {
        let columns = self.with_walls(particles);
        columns.flat_map(|columns| columns.pairs.iter().copied().zip(&columns.geometry))
    }

    /// Forces of A on B [N], once they have been found.
    pub fn forces(&self) -> impl Iterator<Item = (Pair, &Vec3)> {
        self.stretches.iter().flat_map(|columns| columns.pairs.iter().copied().zip(&columns.forces))
    }

    /// Lets a visitor see all contacts whose forces have been found, in the order of [`Self::loaded`].
    pub fn visit(&self, particles: &Particles, visitor: &mut impl Visitor) {
        for Columns { pairs, forces, .. } in &self.stretches {
            visiting::visit((pairs, forces), particles, visitor);
        }
    }

    /// Stretches of contacts with walls, which are separate from the others.
    fn with_walls<'a>(&'a self, particles: &'a Particles) -> impl Iterator<Item = &'a Columns> {
        let is_with_wall = |pair: &Pair| pair.b.index() >= particles.first_facet();
        let has_walls = move |columns: &&Columns| columns.pairs.first().is_some_and(is_with_wall);
        self.stretches.iter().filter(has_walls)
    }

    /// Touching pairs, with their normals and overlaps.
    pub fn iter(&self) -> impl Iterator<Item = (Pair, &Geometry)> {
        self.stretches
            .iter()
            .flat_map(|columns| columns.pairs.iter().copied().zip(&columns.geometry))
    }

    /// Touching pairs, with overlap, normal and contact point.
    pub fn touches<'a>(
        &'a self,
        particles: &'a Particles,
    ) -> impl Iterator<Item = (Pair, Touch)> + 'a {
        self.stretches.iter().flat_map(move |columns| {
            columns.pairs.iter().enumerate().map(move |(place, &pair)| {
                let Geometry { normal, overlap } = columns.geometry[place];
                (pair, Touch { overlap, normal, point: columns.point(place, particles) })
            })
        })
    }

    /// Number of touching pairs.
    pub fn len(&self) -> usize {
        self.stretches.iter().map(|columns| columns.pairs.len()).sum()
    }

    /// Is there no touching pair?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of contacts of each owned particle, with particles and walls.
    pub fn coordination(&self, particles: &Particles) -> Vec<i32> {
        let mut contacts = vec![0; particles.owned];
        for slot in self.iter().flat_map(|(pair, _)| [pair.a, pair.b]) {
            if let Some(count) = contacts.get_mut(particles.body_of(slot).index()) {
                *count += 1;
            }
        }
        contacts
    }

    /// State of each contact, with its permanent name.
    pub fn named<'a>(
        &'a self,
        particles: &'a Particles,
    ) -> impl Iterator<Item = (Pair, ContactRecord<'a>)> {
        self.stretches.iter().flat_map(move |columns| {
            columns.pairs.iter().enumerate().map(move |(place, &pair)| {
                let named = ContactRecord {
                    a: particles.id[pair.a.index()],
                    b: particles.id[pair.b.index()],
                    geometry: columns.geometry[place],
                    state: columns.state(place),
                };
                (pair, named)
            })
        })
    }

    /// Bytes of all columns.
    pub fn bytes(&self) -> usize {
        let columns: usize =
            self.stretches.iter().chain([&self.now]).chain(&self.spare).map(Columns::bytes).sum();
        columns
            + held(&self.previous)
            + held(&self.found)
            + held(&self.order)
            + held(&self.from)
            + held(&self.separated)
            + held(&self.curvatures)
            + held(&self.shares)
    }
}

#[cfg(test)]
mod tests {
    use super::Contacts;
    use crate::contact::{
        ContactRecord, ContactRecords, Geometry, Pair, Previous, StateColumn, Touching,
    };
    use crate::math::Vec3;
    use crate::particles::Particles;
    use crate::particles::crowd::crowd;
    use crate::search::{PairList, close_pairs, in_order};

    const REMEMBERED: [StateColumn; 2] =
        [StateColumn::new("spring", 3, "m"), StateColumn::new("normal_force", 1, "N")];

    /// All pairs of a few bodies, with contacts of every third pair and their state.
    fn remembered(particles: &mut Particles) -> (PairList, Contacts, ContactRecords) {
        let mut list = PairList::default();
        let places = particles.places();
        list.rebuild(particles, close_pairs(particles, 1.0), &places);
        let mut named = ContactRecords::of(&REMEMBERED);
        for (number, pair) in list.pairs.iter().enumerate().step_by(3) {
            named.push(&ContactRecord {
                a: particles.id[pair.a.index()],
                b: particles.id[pair.b.index()],
                geometry: Geometry { normal: Vec3::x(), overlap: 1e-9 * (1 + number) as f64 },
                state: &[0.0, number as f64, 0.0, -(number as f64)],
            });
        }
        // In any order and partly twice, like records from other ranks.
        let mut carried = ContactRecords::of(&REMEMBERED);
        for row in (0..named.len()).rev().chain(0..5) {
            carried.push(&named.get(row));
        }
        let mut contacts = Contacts::of(&REMEMBERED);
        contacts.rebuild(&list, particles, &places, &carried);
        (list, contacts, named)
    }

    #[test]
    fn pairs_stand_in_the_order_of_space_and_contacts_are_carried() {
        let mut particles = crowd(30, false);
        particles.id.reverse();
        let (list, contacts, named) = remembered(&mut particles);
        let ids = |pair: &Pair| [pair.a, pair.b].map(|slot| particles.id[slot.index()]);
        let places = particles.places();
        assert!(list.pairs.len() > 400 && list.pairs.iter().map(ids).all(|[a, b]| a < b));
        assert!(list.pairs.is_sorted_by_key(|pair| in_order(*pair, &places)));
        assert!(!list.pairs.is_sorted_by_key(ids));
        assert!(contacts.named(&particles).map(|(_, named)| named).eq(named.iter()));
    }

    /// State is matched for any order in which resolvers find contacts.
    #[test]
    fn what_is_found_stands_beside_what_was_remembered() {
        let mut particles = crowd(30, false);
        let (list, mut contacts, _) = remembered(&mut particles);
        let stretch = &list.stretches[0];
        let pairs = &list.pairs[stretch.range.clone()];
        // Every second pair touches now; every sixth pair did before and still does.
        let found = (0..pairs.len()).step_by(2);
        let geometry = |pair: usize| Geometry { overlap: pair as f64, ..Geometry::default() };
        let mut touching = Touching {
            pair: found.clone().map(|pair| pair as u32).collect(),
            geometry: found.clone().map(geometry).collect(),
            point: found.map(|pair| Vec3::repeat(pair as f64)).collect(),
            ..Touching::default()
        };
        for _ in 0..2 {
            let mut found = Touching::default();
            contacts.prepare(0, pairs.len(), &mut found, particles.needs);
            found.pair.extend(&touching.pair);
            found.geometry.extend(&touching.geometry);
            found.point.extend(&touching.point);
            contacts.arrange(0, pairs, &mut found, &particles);
            let now = &contacts.now;
            let numbers: Vec<u32> = (0..pairs.len() as u32).step_by(2).collect();
            assert_eq!(now.numbers, numbers);
            for (place, &number) in numbers.iter().enumerate() {
                assert_eq!(now.pairs[place], pairs[number as usize]);
                assert_eq!(now.geometry[place].overlap, f64::from(number));
                assert_eq!(now.points[place].y, f64::from(number));
                let before = if number % 3 == 0 {
                    Previous::at(number as usize / 3)
                } else {
                    Previous::NONE
                };
                assert_eq!(contacts.from[place], before);
            }
            let separated: Vec<_> = contacts
                .separated
                .iter()
                .map(|separated| (separated.place, separated.before))
                .collect();
            let odd = (3..pairs.len()).step_by(6);
            assert_eq!(separated, odd.map(|pair| (pair / 3, pair.div_ceil(2))).collect::<Vec<_>>());
            touching.pair.reverse();
            touching.geometry.reverse();
            touching.point.reverse();
        }
    }
}
