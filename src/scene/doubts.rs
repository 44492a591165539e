//! Warnings about a scene before it runs.

use super::walls::stress_of_force;
use super::{Fill, Goal, Inlet, Method, Mix, Outlet, Rain, Scene, Servo};
use crate::cell::AXES;
use crate::drive::inlet::MOST_AT_ONCE;
use crate::drive::rain::Within;
use crate::drive::region::Region;
use crate::ids::{MaterialId, ShapeId};
use crate::law::hertz::overlap_under;
use crate::law::stability::lost_levers;
use crate::law::{Body, Choice};
use crate::math::Vec3;
use crate::output::table::stressed;
use crate::shape::triangle_mesh::{MeshFacet, Strip};
use crate::shape::{Kind, Shape};
use crate::sim::start::DEEPEST_START;
use crate::walls::{Wall, room};
use std::collections::BTreeSet;

/// Warnings about a scene, a sentence each.
pub fn doubts(scene: &Scene) -> Vec<String> {
    let all = [
        energy_of_erosion(scene),
        energy_of_faces(scene),
        sides_on_faces(scene),
        restless_sides(scene),
        lost_in_rounding(scene),
        rain_cut_short(scene),
        rain_among_walls(scene),
        layers_that_miss(scene),
        friction_in_degrees(scene),
        pressed_flat(scene),
        triangles_elsewhere(scene),
        walls_in_walls(scene),
        shaken_too_fast(scene),
        flat_for_hertz(scene),
        seldom_looked(scene),
        begins_too_late(scene),
        too_many_at_once(scene),
        nothing_leaves(scene),
        area_in_a_pipe(scene),
        rest_beside_drives(scene),
        stop_too_late(scene),
        idle_belt(scene),
        rest_before_an_inlet(scene),
        sizes_of_a_list(scene),
        wall_that_leaves(scene),
        idle_spin(scene),
        scene.jumps.clone(),
        many_snapshots(scene),
        thrown_up(scene),
        falls_out(scene),
    ];
    let read = scene.doubtful.iter().cloned();
    all.into_iter().flatten().chain(scene.left_out.iter().cloned()).chain(read).collect()
}

/// A stop at rest together with walls that move for ever.
fn rest_beside_drives(scene: &Scene) -> Option<String> {
    let asked = [("rest", scene.stop.rest), ("unbalanced", scene.stop.unbalanced)];
    let (key, _) = asked.into_iter().find(|(_, limit)| limit.is_some())?;
    let moves_for_ever = |wall: &&Wall| match &wall.course {
        Some(course) => course.is_endless(),
        None => wall.mass.is_infinite() && (wall.is_moving() || wall.is_belt()),
    };
    let wall = scene.walls.iter().find(moves_for_ever)?;
    let cure = if wall.is_belt() { "End" } else { "Use a table that ends, or end" };
    Some(format!(
        "[stop] `{key}` needs bodies at rest, but wall \"{}\" moves for ever, so it may never be reached. {cure} the \
         stage by its `duration`",
        wall.name
    ))
}

/// A wall of triangles that its velocity moves out of the domain.
fn wall_that_leaves(scene: &Scene) -> Option<String> {
    if scene.start.is_some() {
        // Its position is only known in the run.
        return None;
    }
    let lasts = scene.duration.unwrap_or(scene.steps as f64 * scene.dt);
    let (low, high) = scene.domain.corners();
    scene.walls.iter().find_map(|wall| {
        let (least, most) = wall.extent()?;
        if wall.course.is_some() || wall.may_turn() || wall.mass.is_finite() {
            return None;
        }
        // Time after which all of it is beyond a border.
        let gone = scene.domain.open_axes().filter_map(|k| {
            let speed = wall.velocity[k];
            let way = if speed > 0.0 { high[k] - least[k] } else { low[k] - most[k] };
            (speed != 0.0).then(|| way / speed)
        });
        let gone = gone.fold(f64::INFINITY, f64::min);
        (0.0 < gone && gone < lasts).then(|| {
            format!(
                "wall \"{}\" leaves the domain with its `velocity`: after {gone:.3e} s of {lasts:.3e} s it is \
                 completely outside. For a belt use `surface_velocity`, for a wall that returns a [[motion]]",
                wall.name
            )
        })
    })
}

/// A law of sizes that does not apply to listed particles.
fn sizes_of_a_list(scene: &Scene) -> Option<String> {
    let lists = || {
        scene.initial.iter().filter_map(|fill| match fill {
            Fill::Listed(list) => Some(list),
            Fill::Lattice(_) => None,
        })
    };
    let library = &scene.library;
    let of_lattices = scene.initial.iter().filter_map(|fill| match fill {
        Fill::Lattice(lattice) => Some(&lattice.mix),
        Fill::Listed(_) => None,
    });
    let others = scene.rain.iter().map(|rain| &rain.mix);
    let others = others.chain(scene.inlets.iter().map(|inlet| &inlet.mix)).chain(of_lattices);
    let drawn: Vec<usize> = others.flat_map(Mix::shapes).map(ShapeId::index).collect();
    let is_void = |k: &usize| {
        let mut rows = lists().flatten().filter(|row| row.shape.index() == *k).peekable();
        library.sizes[*k].distribution().is_some()
            && rows.peek().is_some()
            && rows.all(|row| row.scale == 1.0)
            && !drawn.contains(k)
    };
    let shape = (0..library.particle_shapes).find(is_void)?;
    Some(format!(
        "`size` of shape `{}` has no effect: it is for lattices, rain and inlets, and all particles of [[fill.file]] \
         have scale 1. Give the file a column `scale`",
        library.names[shape]
    ))
}

/// A `[stop]` that may hold before an endless inlet begins.
fn rest_before_an_inlet(scene: &Scene) -> Option<String> {
    let asked = [("rest", scene.stop.rest), ("unbalanced", scene.stop.unbalanced)];
    let (key, _) = asked.into_iter().find(|(_, limit)| limit.is_some())?;
    let inlet = scene.inlets.iter().find(|inlet| inlet.begin > 0.0 && inlet.until.is_none())?;
    (scene.stop.after < inlet.begin).then(|| {
        format!(
            "[stop] `{key}` may be reached before inlet `{}` begins at {:?} s, because the stage does not wait for \
             inlets without end: set `after` in [stop] to a later time",
            inlet.name, inlet.begin
        )
    })
}

/// A belt without friction.
fn idle_belt(scene: &Scene) -> Option<String> {
    let belt = scene.walls.iter().find(|wall| wall.is_belt())?;
    (scene.law.highest_friction() == 0.0).then(|| {
        format!("wall \"{}\" has a `surface_velocity`, but no effect without friction", belt.name)
    })
}

/// Particles with a spin that do not turn.
fn idle_spin(scene: &Scene) -> Option<String> {
    let inlet = scene.inlets.iter().find(|inlet| inlet.spin > 0.0)?;
    (!scene.needs().spin).then(|| {
        format!(
            "`spin` of inlet `{}` is ignored: spheres without friction do not rotate",
            inlet.name
        )
    })
}

/// A `[stop]` that is first checked after the end of the stage.
fn stop_too_late(scene: &Scene) -> Option<String> {
    let lasts = scene.duration.unwrap_or(scene.steps as f64 * scene.dt);
    (scene.stop.after > lasts + 0.5 * scene.dt).then(|| {
        format!(
            "[stop] is checked only after {} s, but the stage lasts {lasts:.3e} s: it will run to its end",
            scene.stop.after
        )
    })
}

/// An inlet or an outlet whose interval is longer than the stage.
fn seldom_looked(scene: &Scene) -> Option<String> {
    let inlets = scene.inlets.iter().map(|inlet| ("inlet", &inlet.name, inlet.every));
    let outlets = scene.outlets.iter().map(|outlet| ("outlet", &outlet.name, outlet.every));
    let (what, name, every) = inlets.chain(outlets).find(|&(.., every)| every > scene.steps)?;
    Some(format!(
        "{what} `{name}` acts every {every} steps, and the stage has {}: it never acts",
        scene.steps
    ))
}

/// Last time at which particles of an inlet may appear, in s of the stage.
fn last_look(scene: &Scene, inlet: &Inlet) -> f64 {
    (scene.steps / inlet.every * inlet.every) as f64 * scene.dt
}

/// An inlet that begins after the end of the stage.
fn begins_too_late(scene: &Scene) -> Option<String> {
    let is_late = |inlet: &&Inlet| {
        let last = last_look(scene, inlet);
        last > 0.0 && inlet.begin + 0.5 * scene.dt > last
    };
    let inlet = scene.inlets.iter().find(is_late)?;
    Some(format!(
        "inlet `{}` begins after {:?} s of the stage, but can insert particles only until {:.3e} s: it inserts none",
        inlet.name,
        inlet.begin,
        last_look(scene, inlet)
    ))
}

/// An inlet with more due particles at a time than can appear.
fn too_many_at_once(scene: &Scene) -> Option<String> {
    scene.inlets.iter().find_map(|inlet| {
        let between_looks = inlet.every as f64 * scene.dt;
        let feeds = last_look(scene, inlet) - inlet.begin;
        let at_once = inlet.due_within(between_looks.min(feeds), &scene.library);
        (at_once > MOST_AT_ONCE).then(|| {
            format!(
                "inlet `{}`: some {at_once} particles are due every {} steps, but the maximum is {MOST_AT_ONCE} at a \
                 time: make `every` smaller",
                inlet.name, inlet.every
            )
        })
    })
}

/// A servo, or a written stress, whose area may be reduced by walls that are not planes across an axis.
fn area_in_a_pipe(scene: &Scene) -> Option<String> {
    let (walls, domain) = (&scene.walls, &scene.domain);
    let other = walls.iter().find(|wall| wall.across().is_none())?;
    let of_stress = |servo: &&Servo| matches!(servo.goal, Goal::Stress(_));
    let of_servo = scene.servos.iter().find(of_stress).map(|servo| {
        (format!("the stress on wall {}", servo.names(walls)), servo.area(walls, domain))
    });
    let written = || {
        let (wall, area) = stressed(walls, domain).next()?;
        Some((format!("`stress_{}_Pa` of history.csv", wall.name), area))
    };
    let (stress, area) = of_servo.or_else(written)?;
    Some(format!(
        "{stress} is force over {area:.4e} m2, the area between planes and periods: the area is not reduced by wall \
         \"{}\"",
        other.name
    ))
}

/// An outlet that no particle can reach.
fn nothing_leaves(scene: &Scene) -> Option<String> {
    if scene.walls.iter().any(|wall| wall.moves) {
        // The positions of walls are only known in the run.
        return None;
    }
    // A centre that is farther outside than its radius stops the run.
    let far = Vec3::repeat(scene.library.largest_radius());
    let (low, high) = room(&scene.walls, &scene.domain);
    let (low, high) = (low - far, high + far);
    let outside = |outlet: &&Outlet| match (&outlet.region, outlet.region.bounds()) {
        (_, Some((l, h))) => {
            scene.domain.open_axes().any(|axis| l[axis] > high[axis] || h[axis] < low[axis])
        }
        (Region::Behind { point, normal }, _) => {
            let lowest = Vec3::from_fn(|k, _| if normal[k] > 0.0 { low[k] } else { high[k] });
            normal.dot(&(lowest - point)) >= 0.0
        }
        _ => false,
    };
    let outlet = scene.outlets.iter().find(outside)?;
    Some(format!(
        "outlet `{}` is outside the domain by more than a radius: it removes no particle, and the run stops when one \
         leaves the domain",
        outlet.name
    ))
}

/// A coefficient of friction as large as an angle of friction.
fn friction_in_degrees(scene: &Scene) -> Option<String> {
    let friction = scene.law.highest_friction();
    (5.0..=60.0).contains(&friction).then(|| {
        format!(
            "friction is {friction}: if this is an angle in degrees, its coefficient is {:.2}",
            libm::tan(friction.to_radians())
        )
    })
}

/// An oscillation of a wall that the steps do not resolve.
fn shaken_too_fast(scene: &Scene) -> Option<String> {
    const STEPS: f64 = 20.0;
    scene.walls.iter().find_map(|wall| {
        let steps = wall.course.as_ref()?.shortest_period()? / scene.dt;
        (steps < STEPS).then(|| {
            format!(
                "wall \"{}\" oscillates once in {steps:.1} steps: at least {STEPS} are needed to resolve its motion",
                wall.name
            )
        })
    })
}

/// A wall of triangles outside the domain, or many times as large: usually by wrong units in its file.
fn triangles_elsewhere(scene: &Scene) -> Option<String> {
    const LARGE: f64 = 10.0;
    let (low, high) = scene.domain.corners();
    let size = scene.domain.sides().amax();
    scene.walls.iter().find_map(|wall| {
        let (lowest, highest) = wall.extent()?;
        let apart = (0..3).any(|k| lowest[k] > high[k] || highest[k] < low[k]);
        let times = (highest - lowest).amax() / size;
        let what = if apart {
            "is outside the domain".to_owned()
        } else if times > LARGE {
            format!("is {times:.0} times as large as the domain")
        } else {
            return None;
        };
        Some(format!(
            "wall \"{}\" {what}: check the `scale` of its mesh, such as 0.001 for millimetres",
            wall.name
        ))
    })
}

/// Coincident walls, with which particles have one contact.
fn walls_in_walls(scene: &Scene) -> Option<String> {
    const TOLERANCE: f64 = 1e-6;
    const NAMED: usize = 5;
    let tolerance = TOLERANCE * scene.domain.sides().amax();
    let walls = &scene.walls;
    let extents: Vec<_> = walls.iter().map(Wall::extent).collect();
    let pairs = (0..walls.len()).flat_map(|k| (0..=k).map(move |other| (other, k)));
    let coincide = |&(one, other): &(usize, usize)| {
        let are_apart = extents[one].zip(extents[other]).is_some_and(|(one, other)| {
            (0..3).any(|k| one.1[k] < other.0[k] - tolerance || other.1[k] < one.0[k] - tolerance)
        });
        let (one, other) = (&walls[one], &walls[other]);
        !are_apart && (one.lies_in(other, tolerance) || other.lies_in(one, tolerance))
    };
    let name = |(one, other): (usize, usize)| {
        if one == other {
            format!("faces of \"{}\"", walls[one].name)
        } else {
            format!("\"{}\" and \"{}\"", walls[one].name, walls[other].name)
        }
    };
    let mut found: Vec<String> = pairs.filter(coincide).take(NAMED + 1).map(name).collect();
    if found.len() > NAMED {
        found.truncate(NAMED);
        found.push("...".to_owned());
    }
    (!found.is_empty()).then(|| {
        format!(
            "walls coincide: {}. There a particle has one contact, with the plane, or with the wall of the larger \
             overlap",
            found.join(", ")
        )
    })
}

/// Increase of the stiffness of Hertzian contacts by a bend of a wall above which a warning is given.
const BENT: f64 = 0.01;

/// Hertz's law treats cylinders and cones as flat. From inside contacts are stiffer by a fourth of the ratio of the radii.
fn flat_for_hertz(scene: &Scene) -> Option<String> {
    let radius = |strip: &Strip| {
        let end = strip.radius + strip.slope * strip.length;
        // At the tip of a cone the relevant radius is that of the particles there.
        if end.min(strip.radius) > 0.0 {
            end.min(strip.radius)
        } else {
            0.5 * end.max(strip.radius)
        }
    };
    let meshes = scene.walls.iter().filter_map(|wall| Some((wall, wall.mesh.as_ref()?)));
    let round = meshes.filter_map(|(wall, mesh)| match mesh.surface.facets().next()? {
        MeshFacet::Strip(strip) => Some((wall, radius(&strip))),
        _ => None,
    });
    let (wall, radius) = round.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let stiffer = 0.25 * scene.library.largest_radius() / radius;
    (scene.law.linear().is_none() && stiffer > BENT).then(|| {
        format!(
            "Hertz' law treats the curved wall \"{}\" as flat: its contacts are up to {:.0} % stiffer than exact",
            wall.name,
            100.0 * stiffer
        )
    })
}

/// A servo or a loaded wall that presses particles into each other too deeply: by about `p d / k` of their diameter, as in
/// a row of them.
fn pressed_flat(scene: &Scene) -> Option<String> {
    let Scene { walls, domain, .. } = scene;
    let of_servo = |servo: &Servo| match servo.goal {
        Goal::Stress(stress) => ("a servo of".to_owned(), stress),
        Goal::Force { newtons, .. } => {
            let stress = stress_of_force(newtons, &domain.sides());
            (
                format!("a servo of {newtons:e} N, on the smallest side of the domain a stress of"),
                stress,
            )
        }
    };
    let by_servos = scene.servos.iter().map(of_servo);
    let by_load = scene.free_walls.iter().filter_map(|free| {
        let who = format!("wall \"{}\" with a load of", walls[free.wall].name);
        Some((who, free.stress(walls, domain)?))
    });
    let (who, stress) = by_servos.chain(by_load).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let law = scene.force_law();
    let mean = |(shape, scale)| {
        let body = Body::of(&scene.library, shape, scale);
        let volume = scene.library.shapes[shape.index()].volume() * scale.powi(3);
        let diameter = libm::cbrt(6.0 * volume / std::f64::consts::PI);
        stress * diameter / law.about().hardest(&body, body.material, 0.5 * body.mass).stiffness
    };
    // Where contacts stiffen with load, this is the overlap of the few most loaded ones.
    let elastic = match scene.law.forces() {
        Choice::Hertz(settings) => Some(settings),
        Choice::Jkr(settings) => Some(&settings.elastic),
        _ => None,
    };
    let (how, deepest) = match elastic {
        Some(settings) => {
            let grains: BTreeSet<MaterialId> =
                scene.library.materials[..scene.library.particle_shapes].iter().copied().collect();
            let pairs = grains.iter().flat_map(|&a| grains.iter().map(move |&b| (a, b)));
            let under = |(a, b)| overlap_under(stress, &settings.interactions.of(a, b));
            ("up to", 0.5 * pairs.map(under).fold(0.0, f64::max))
        }
        None => ("some", scene.library.extremes().map(mean).fold(0.0, f64::max)),
    };
    (deepest > DEEPEST_START).then(|| {
        format!(
            "{who} {stress:e} Pa causes overlaps of {how} {:.0} % of the particle diameter; DEM commonly permits {} \
             %: make contacts stiffer or the load smaller",
            100.0 * deepest,
            100.0 * DEEPEST_START
        )
    })
}

/// Forces along a normal other than that of the least overlap have no potential. Spheres are resolved in closed form. The
/// figures are the worst of 100 collisions of each pair of bodies in `collisions_by_erosion_do_not_keep_their_energy`.
fn energy_of_erosion(scene: &Scene) -> Option<String> {
    let grains = &scene.library.shapes[..scene.library.particle_shapes];
    let is_approximate = |shape: &Shape| shape.kind() != Kind::Sphere;
    (matches!(scene.method, Method::GjkErosion(_)) && grains.iter().any(is_approximate)).then(|| {
        "gjk-erosion uses a normal other than that of the least overlap, so collisions gain or lose energy. At \
         overlaps of 1 % the error is up to 9 % for ellipsoids of 2:1, and up to 41 % for superellipsoids. Use method \
         = \"auto\""
            .to_owned()
    })
}

/// The depth has a kink where faces are flush, which adds energy to resting bodies.
fn energy_of_faces(scene: &Scene) -> Option<String> {
    let has_faces = scene.particle_kinds().into_iter().any(|kind| kind.extended()[0] > 0);
    let by_depth = matches!(scene.method, Method::GjkErosion(_) | Method::Epa(_));
    (has_faces && by_depth).then(|| {
        format!(
            "with method = \"{}\" the contact point of faces and straight sides jumps between corners: contacts gain \
             energy, and particles do not come to rest. Use method = \"auto\"",
            scene.method.name()
        )
    })
}

/// Spherocylinders with polyhedra: a spherocylinder has an extended contact only with its like and with walls.
fn sides_on_faces(scene: &Scene) -> Option<String> {
    let kinds = scene.particle_kinds();
    let is_there = |has: fn(Kind) -> bool| kinds.iter().any(|&kind| has(kind));
    (is_there(Kind::has_side) && is_there(Kind::has_faces)).then(|| {
        "the contact point of a spherocylinder on a face of a polyhedron jumps between its ends: it rocks without \
         coming to rest. Replace one of them by a `rounded-polyhedron`"
            .to_owned()
    })
}

/// Part of a side's half length, around its middle, within which contacts may add energy to a body. Blocks half a metre
/// long, on slopes up to 0.96 of friction's tangent, creep by at most 6e-7 m/s below this part. Above it they creep by up
/// to 6e-2 m/s: see `benchmarks/verification/cases/steps.rs`.
const RESTLESS: f64 = 0.15;

/// Nearly flat sides, in the middle of which a contact turns a particle back faster than steps can follow.
pub fn restless_sides(scene: &Scene) -> Option<String> {
    let library = &scene.library;
    let acceleration = scene.gravity.norm();
    let part = |shape: &Shape, scale: f64, dt: f64| lost_levers(shape, scale, acceleration, dt);
    let by_point = |id: ShapeId| {
        let kind = library.shapes[id.index()].kind();
        kind != Kind::Union && kind.extended()[0] == 0
    };
    let (part_of_worst, id, scale) = library
        .extremes()
        .filter(|&(id, _)| by_point(id))
        .map(|(id, scale)| (part(&library.shapes[id.index()], scale, scene.dt), id, scale))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(part, ..)| *part > RESTLESS)?;
    let shape = &library.shapes[id.index()];
    let mut instead = Vec::new();
    let rests = |shape: &Shape| part(shape, scale, scene.dt) <= RESTLESS;
    if let Some(least) = (2..20)
        .map(|k| 0.05 * f64::from(k))
        .find(|&e| shape.with_exponents_from(e).is_some_and(|s| rests(&s)))
    {
        instead.push(format!("exponents of {least:.2} or more"));
    }
    if let Some(dt) =
        (1..5).map(|k| scene.dt / f64::from(1 << k)).find(|&dt| part(shape, scale, dt) <= RESTLESS)
    {
        instead.push(format!("a step of {dt:.1e} s"));
    }
    instead.push("a `polyhedron` or `rounded-polyhedron`".to_owned());
    Some(format!(
        "shape `{}` is too flat for steps of {:e} s: rotation under its weight is not resolved within {:.0} % of the \
         half length around the middle of a side. Such particles rock without coming to rest, and creep on slopes. \
         Use {}",
        library.names[id.index()],
        scene.dt,
        100.0 * part_of_worst,
        instead.join(", or "),
    ))
}

/// Rain that cannot fall in full: a layer appears when the one before has fallen out of the slab.
fn rain_cut_short(scene: &Scene) -> Option<String> {
    let rain = scene.rain.as_ref()?;
    if rain.every > scene.steps {
        return Some(format!(
            "no rain will fall: the first layer appears at step {}, but the stage has {} steps. Make `every` smaller",
            rain.every, scene.steps
        ));
    }
    let Some(interval) = rain.interval(&scene.gravity, &scene.domain, scene.dt) else {
        return (rain.layers() > 1).then(|| {
            "the first layer of rain never leaves its slab, so no other follows: give it a `velocity`".to_owned()
        });
    };
    let last = (rain.layers() - 1).saturating_mul(interval).saturating_add(rain.every);
    if last >= scene.steps {
        return Some(format!(
            "the last layers of rain will not fall: a layer leaves its slab after {interval} steps, so the last of {} \
             appears at step {last} or later, but the stage has {} steps. Use more steps, a thinner slab, or {}",
            rain.layers(),
            scene.steps,
            more_speed(rain)
        ));
    }
    let (low, high) = scene.domain.corners();
    let fall = rain.fall(&low, &high, bed(scene, rain), &scene.gravity, scene.dt)?;
    (last.saturating_add(fall) >= scene.steps).then(|| {
        format!(
            "the last layers of rain will not reach the bed: the last appears at step {last} or later and needs some \
             {fall} steps, but the stage has {} steps. Use more steps, or {}",
            scene.steps,
            more_speed(rain)
        )
    })
}

/// Walls that reduce the places of a layer.
fn rain_among_walls(scene: &Scene) -> Option<String> {
    let Within { places, free, .. } = scene.rain.as_ref()?.within.as_ref()?;
    (free < places).then(|| {
        format!(
            "only some {free} of {places} places of a layer of rain are clear of walls: for another region use `low` \
             and `high`, or `axis` and `radius`"
        )
    })
}

/// Number of snapshots above which a mistake is likely.
const MANY_SNAPSHOTS: u64 = 10_000;

/// A snapshot at nearly every step.
fn many_snapshots(scene: &Scene) -> Option<String> {
    let count = scene.steps.checked_div(scene.snapshot_every)?;
    (count > MANY_SNAPSHOTS).then(|| {
        format!(
            "snapshot_every = {} writes some {count} snapshots of two files each: make it larger",
            scene.snapshot_every
        )
    })
}

/// Rain with an upward initial velocity.
fn thrown_up(scene: &Scene) -> Option<String> {
    let rain = scene.rain.as_ref()?;
    (rain.velocity.dot(&scene.gravity) < 0.0).then(|| {
        "the `velocity` of [fill.rain] is opposite to `gravity`: its particles rise first, and fall back into later \
         layers. Change its sign"
            .to_owned()
    })
}

/// A side of the domain without a wall, through which particles fall.
fn falls_out(scene: &Scene) -> Option<String> {
    let Scene { gravity, walls, domain, .. } = scene;
    let axis = gravity.iamax();
    let inwards = -gravity[axis].signum();
    let faces = domain.faces();
    let face = faces.iter().find(|face| face.axis == axis && face.normal[axis] == inwards)?;
    let may_fall = gravity[axis] != 0.0
        && !face.repeats
        && scene.outlets.is_empty()
        && !walls.iter().any(|wall| wall.holds_against(gravity));
    let height = domain.sides()[axis];
    let lasts = scene.duration.unwrap_or(scene.steps as f64 * scene.dt);
    let falls = 0.5 * gravity[axis].abs() * lasts * lasts > height;
    (may_fall && falls).then(|| {
        format!(
            "gravity pulls particles out through the side {} of the domain, which has no wall: the run stops when the \
             first one leaves. Put a wall there, or an [[outlet]]",
            face.name
        )
    })
}

/// Advice to make rain fall faster.
fn more_speed(rain: &Rain) -> &'static str {
    if rain.velocity == Vec3::zeros() { "give it a `velocity`" } else { "more `velocity`" }
}

/// Depth of the rain on a floor as wide as the domain [m], packed like spheres at their densest in disorder.
fn bed(scene: &Scene, rain: &Rain) -> f64 {
    let library = &scene.library;
    let mean = library.mean_over(&rain.mix, |shape| library.shapes[shape.index()].volume());
    let extent = scene.domain.sides();
    let axis = if scene.gravity == Vec3::zeros() { 2 } else { scene.gravity.iamax() };
    rain.count as f64 * mean / 0.64 * extent[axis] / extent.product()
}

/// A sheared lattice, which stays in layers until they touch.
fn layers_that_miss(scene: &Scene) -> Option<String> {
    let (across, [Fill::Lattice(lattice)]) = (scene.domain.shear()?.across, &scene.initial[..])
    else {
        return None;
    };
    let library = &scene.library;
    let width = |id: ShapeId| {
        let [_, scale] = library.sizes[id.index()].scales();
        2.0 * library.radius[id.index()] * scale
    };
    let widest = lattice.mix.shapes().map(width).fold(0.0, f64::max);
    let apart = lattice.spacing[across] - 2.0 * lattice.jitter;
    (apart >= widest).then(|| {
        format!(
            "layers of the lattice are at least {apart:.3e} m apart along {}, and particles at most {widest:.3e} m \
             wide: the sheared layers may never touch. Put a second lattice into the gaps, or `start` from a packing \
             of a stage before",
            AXES[across]
        )
    })
}

// --- rounding: far from the origin, positions are so coarse that a short step of a slow body is lost or doubled ---

/// Part of a motion that may be rounded off in a step.
const ROUNDED_OFF: f64 = 0.01;
/// Speed over that of a fall over a particle's radius below which motion is irrelevant.
const SLOW: f64 = 1e-6;

/// Largest rounding of a coordinate, where the largest one is this [m].
fn rounding(farthest: f64) -> f64 {
    0.5 * f64::EPSILON * farthest
}

/// A warning about motions of the scene that rounding would change; `None` if there are none.
fn lost_in_rounding(scene: &Scene) -> Option<String> {
    let mut worst: Option<(f64, String)> = None;
    let mut note = |what: &dyn Fn() -> String, farthest: f64, velocity: &Vec3| {
        let part = rounding(farthest) / (velocity.norm() * scene.dt);
        let known = worst.as_ref().map_or(ROUNDED_OFF, |(part, _)| *part);
        if *velocity != Vec3::zeros() && part > known {
            worst = Some((part, format!("{} at {:e} m/s", what(), velocity.norm())));
        }
    };
    // A course has its place at any time in closed form.
    for wall in scene.walls.iter().filter(|wall| wall.course.is_none()) {
        note(&|| format!("wall \"{}\"", wall.name), wall.point.amax(), &wall.velocity);
    }
    for fill in &scene.initial {
        match fill {
            Fill::Lattice(lattice) => {
                let count = Vec3::from(lattice.count.map(f64::from)) - Vec3::repeat(1.0);
                let last = lattice.first + lattice.spacing.component_mul(&count);
                let farthest = lattice.first.amax().max(last.amax());
                note(&|| "a particle of a lattice".to_owned(), farthest, &lattice.velocity);
            }
            Fill::Listed(rows) => {
                for row in rows {
                    let farthest = row.position.amax();
                    note(&|| "a particle of a file".to_owned(), farthest, &row.velocity);
                }
            }
        }
    }
    if let Some(rain) = &scene.rain {
        let farthest = rain.low.amax().max(rain.high.amax());
        note(&|| "rain".to_owned(), farthest, &rain.velocity);
    }
    if let Some((part, what)) = worst {
        return Some(format!(
            "up to {:.2} % of a step of {what} is lost in rounding, because of the distance to the origin: put the \
             origin near the particles, or use a longer time step",
            100.0 * part.min(1.0)
        ));
    }
    let (low, high) = scene.domain.corners();
    let lost = rounding(low.amax().max(high.amax())) / scene.dt;
    let fall = (scene.gravity.norm() * scene.library.least_inscribed_radius()).sqrt();
    (fall.is_finite() && lost > SLOW * fall && fall > 0.0).then(|| {
        format!(
            "at the far corner of the domain, motion slower than {lost:.1e} m/s is lost in rounding: put the origin \
             near the particles"
        )
    })
}
