//! Plots and the page.

use super::fabric::contacts_with;
use crate::support::packings::{
    Snapshot, ellipsoids, header, particles_at, plane_row, push, push_force,
};
use dem_mpi::cell::Cell;
use dem_mpi::contact::StateColumn;
use dem_mpi::drive::{SavedColumn, SavedState, Values, servo};
use dem_mpi::ids::GlobalId;
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::output::header::{Header, WallRow};
use dem_mpi::output::tables::{ContactTable, ParticleTable};
use dem_mpi::post::draw::{BLUE, Mark, SIZE, Series, chart, linear};
use dem_mpi::post::history::History;
use dem_mpi::post::page::{self, Page, Section};
use dem_mpi::post::region::{Bounds, Region};
use dem_mpi::post::views::{Layer, Views};
use dem_mpi::post::{Settings, panels, plots};
use dem_mpi::walls::Wall;

pub(super) fn views(snapshot: &Snapshot, bounds: &Bounds) -> Views {
    let volume = snapshot.header.shapes[0].volume;
    let mut views =
        Views::new(&snapshot.header, bounds, (6.0 / std::f64::consts::PI * volume).cbrt());
    views.add_particles(&snapshot.header, &snapshot.particles);
    views.add_contacts(&snapshot.header, &snapshot.contacts);
    views
}

/// Every plot and the page of a snapshot.
fn drawn(snapshot: &Snapshot, history: &str) -> Vec<(String, String)> {
    let analysis = snapshot.analyse(Settings::default()).unwrap();
    let mut later = analysis.report.clone();
    later.strain_against(&analysis.report);
    let picture = analysis.picture.svg(analysis.report.bounds_m.as_ref());
    let reports = [analysis.report, later];
    let history = History::read(history.as_bytes()).unwrap();
    let views = reports[0].bounds_m.map(|bounds| views(snapshot, &bounds));
    let walls = &snapshot.header.walls;
    let sections =
        page::sections(&reports, None, picture, views.as_ref(), &history, walls, &[]).unwrap();
    let page = Page {
        title: "a <title>",
        command: "",
        warnings: &[],
        reports: &reports,
        requested: &[],
        sections: &sections,
    };
    let mut drawings: Vec<_> = page.plots().map(|p| (p.name.clone(), p.svg.clone())).collect();
    drawings.push(("page".into(), page.html()));
    drawings
}

/// Texts of a drawing.
fn texts(svg: &str) -> Vec<&str> {
    svg.split("</text>").filter_map(|part| part.rsplit('>').next()).map(str::trim).collect()
}

/// Ticks close to each other, far from 0, have the digits in which they differ.
#[test]
fn neighbouring_ticks_have_different_labels() {
    for (low, high, some) in [
        (123_400.0, 124_000.0, "1.236·10⁵"),
        (0.250_000_1, 0.250_000_6, "0.2500003"),
        (99_999.0, 100_002.0, "1·10⁵"),
    ] {
        let points = vec![(0.0, low), (1.0, high)];
        let line = Series { name: String::new(), colour: BLUE, mark: Mark::Line, points };
        let svg = chart(SIZE, &linear("x", "y", 0.0..1.0, low..high), &[line]).unwrap();
        let mut labels = texts(&svg);
        assert!(labels.contains(&some), "{labels:?}");
        labels.retain(|label| label.len() > 3);
        let before = labels.len();
        labels.sort_unstable();
        labels.dedup();
        assert!(before > 2 && before == labels.len(), "{labels:?}");
    }
}

/// Sums of steps between ticks give about 1e-17 in place of 0, but the label is 0.
#[test]
fn zero_is_labelled_zero() {
    for reach in [0.3, 0.6, 7e-4, 1.1, 3.3e3, 6e-6, 0.12] {
        for low in [-1.0, -0.5, -0.7] {
            let range = low * reach..reach;
            let points = vec![(range.start, range.start), (range.end, range.end)];
            let line = Series { name: String::new(), colour: BLUE, mark: Mark::Line, points };
            let svg =
                chart(SIZE, &linear("x", "y", range.clone(), range.clone()), &[line]).unwrap();
            let labels = texts(&svg);
            let is_hair = |label: &&&str| ["⁻¹", "⁻²"].iter().any(|power| label.contains(power));
            assert_eq!(labels.iter().find(is_hair), None, "{range:?}: {labels:?}");
            assert!(labels.contains(&"0"), "{range:?}: {labels:?}");
        }
    }
}

#[test]
fn plots_are_finite_for_empty_tiny_and_usual_snapshots() {
    let nothing = Snapshot {
        header: header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 0),
        particles: ParticleTable::default(),
        contacts: ContactTable::default(),
    };
    let (_, contacts) = contacts_with(&[Vec3::z()], &[(0.0, Vec3::zeros())]);
    let two = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
    let one_contact = Snapshot {
        header: header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2),
        particles: two,
        contacts,
    };
    let mut with_force = one_contact.clone();
    with_force.contacts.normal_force[0] = 1.0;
    let usual = ellipsoids(5, 8);
    let flat = "time,energy\n0,0\n1,0\n";
    let steep = "time,energy\n0,1e9\n1,1e-3\n2,1e-12\n";
    let odd = "time,kinetic_J,missing_J,largest_overlap,top_m,other\n\
               0,0,-1e-17,0,-inf,1e300\n1,1,0,-1,NaN,-1e300\n2,1e-320,1e-3,0,0.1,inf\n3,1e300,-2,0,0.2,1\n";
    for (name, snapshot) in
        [("nothing", &nothing), ("one", &one_contact), ("force", &with_force), ("usual", &usual)]
    {
        for history in [flat, steep, odd] {
            for (plot, svg) in drawn(snapshot, history) {
                for bad in ["NaN", "nan\"", "inf\"", "Infinity", "-inf"] {
                    assert!(!svg.contains(bad), "{name}: {plot} holds {bad}");
                }
                // The library plotters would saturate a coordinate that is not finite.
                assert!(
                    !svg.contains("2147483647") && !svg.contains("-2147483648"),
                    "{name}: {plot}"
                );
            }
        }
    }
    let (_, page) = drawn(&usual, steep).pop().unwrap();
    assert!(page.contains("<title>a &lt;title&gt;</title>"));
    assert!(!page.contains("<script") && !page.contains("src="));
    let mut links = page.split("href=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    let is_there = |link: &str| {
        link.strip_prefix('#').is_some_and(|id| page.contains(&format!(" id=\"{id}\"")))
    };
    assert_eq!(links.find(|link| !is_there(link)), None);
}

/// Results stand before plots and plots before tables, as in the list of contents. Nothing is empty.
#[test]
fn the_page_begins_with_what_was_requested() {
    let snapshot = ellipsoids(3, 8);
    let mut report = snapshot.report();
    report.summary.q_pa = None;
    let reports = vec![report; 3];
    let history = History::read("time,energy\n0,1\n1,2\n".as_bytes()).unwrap();
    let mut sections = page::sections(
        &reports,
        Some("<svg></svg>".into()),
        "<svg></svg>".into(),
        None,
        &history,
        &[],
        &[],
    )
    .unwrap();
    let requested = sections[2].plots.clone();
    sections.push(Section { title: "Nothing", plots: Vec::new() });
    let page = Page {
        title: "falling",
        command: "",
        warnings: &[],
        reports: &reports,
        requested: &requested,
        sections: &sections,
    };
    let html = page.html();
    let expected =
        ["Results", "Series", "Last snapshot", "History of the run", "Numbers", "All snapshots"];
    let headings = |begin: &str, end: &str| -> Vec<String> {
        let parts = html.split(begin).skip(1);
        parts.map(|part| part.split(end).next().unwrap().to_owned()).collect()
    };
    assert_eq!(headings("<h2>", "</h2>"), expected);
    let links = headings("<a href=\"#section-", "</a>");
    let titles: Vec<_> = links.iter().filter_map(|link| link.split('>').nth(1)).collect();
    assert_eq!(titles, expected);
    let place = |text: &str| html.find(text).unwrap_or_else(|| panic!("no {text}"));
    assert!(place("id=\"snapshots\"") < place("id=\"stress_ratio\""));
    assert!(place("<nav>") < place("id=\"history_energy\""));
    assert!(place("id=\"history_energy\"") < place("id=\"packing\""));
    assert!(place("id=\"packing\"") < place("<table>"));
    // Rows and columns without any value are left out.
    assert!(!html.contains("<td>–</td>") && !html.contains("deviatoric stress q"));
    assert!(html.contains("mean stress p") && !html.contains("shear strain"));
}

#[test]
fn columns_that_belong_together_share_a_panel() {
    let walls = ["-x", "lid"].map(|name| plane_row(name, Vec3::zeros(), Vec3::new(0.6, 0.0, -0.8)));
    let table = "time_s,particles,contacts,kinetic_J,translation_J,gravity_J,missing_J,\
                 force_-x_x_N,force_-x_y_N,force_-x_z_N,force_+x_x_N,force_-x_x-N,still\n\
                 0,1,0,0,0,1,0,0,0,0,0,0,3\n1,2,1,0.5,0.5,0,-1e-9,-3,5,4,1,1,3\n";
    let history = History::read(table.as_bytes()).unwrap();
    let names = |walls: &[WallRow]| -> Vec<String> {
        let plots = panels::panels(&history, walls, &[]).unwrap();
        plots.into_iter().map(|plot| plot.name.replace("history_", "")).collect()
    };
    let unknown = ["force_plus_x_x_n", "force_minus_x_x_n"];
    let (plus, minus) = (unknown[0], unknown[1]);
    assert_eq!(names(&walls), ["counts", "energy", "wall_loads", plus, minus]);
    let twice = format!("{minus}_2");
    let components = [minus, "force_minus_x_y_n", "force_minus_x_z_n"];
    let alone = [&["counts", "energy"][..], &components, &[plus, &twice]].concat();
    assert_eq!(names(&[]), alone, "without walls each component stands alone");
    let plots = panels::panels(&history, &walls, &[]).unwrap();
    // -(-3 · 0.6 + 4 · (-0.8)) = 5 N
    assert!(plots[2].svg.contains("-x") && !plots[2].svg.contains("lid"));
    assert!(plots[2].svg.contains(">\n5\n<"), "{}", plots[2].svg);
}

/// A rotating wall, or one of several planes, has no load along its normal. Torques and powers have their units.
#[test]
fn walls_that_turn_have_no_load() {
    let row = |name: &str, body| WallRow { body, ..plane_row(name, Vec3::zeros(), Vec3::z()) };
    let planes = [(Vec3::zeros(), Vec3::z()), (Vec3::zeros(), Vec3::x())];
    let trough = Wall::of_planes("trough".to_owned(), Vec3::zeros(), &planes).saved();
    let walls = [row("flap", None), row("trough", trough)];
    let columns = [
        "force_flap_x_N",
        "force_flap_y_N",
        "force_flap_z_N",
        "force_trough_x_N",
        "force_trough_y_N",
        "force_trough_z_N",
        "turned_flap_x_rad",
        "torque_flap_x_N_m",
        "power_flap_W",
        "angular_velocity_flap_y_rad_per_s",
        "left_Big_hole_kg",
        "entered_top",
        "mean_m_per_s",
    ];
    let rows = [0, 1].map(|row| columns.map(|_| row.to_string()).join(","));
    let table = format!("time_s,{}\n0,{}\n1,{}\n", columns.join(","), rows[0], rows[1]);
    let history = History::read(table.as_bytes()).unwrap();
    let plots = panels::panels(&history, &walls, &[]).unwrap();
    assert!(plots.iter().all(|plot| plot.name != "history_wall_loads"));
    let unit_of = |title: &str| {
        let plot = plots.iter().find(|plot| plot.title == title);
        plot.unwrap_or_else(|| {
            panic!("no {title}: {:?}", plots.iter().map(|p| &p.title).collect::<Vec<_>>())
        })
        .svg
        .clone()
    };
    for (title, unit) in [
        ("Torque on flap about x", "torque on flap about x (N m)"),
        ("Power of flap", "power of flap (W)"),
        ("Rotation of flap about x", "rotation of flap about x (rad)"),
        ("Angular velocity of flap about y", "angular velocity of flap about y (rad/s)"),
        ("Force on flap along z", "force on flap along z (N)"),
        ("Force on trough along x", "force on trough along x (N)"),
        ("Mass left through Big hole", "mass left through Big hole (kg)"),
        ("Particles entered through top", "particles entered through top"),
        ("Mean", "mean (m/s)"),
    ] {
        assert!(unit_of(title).contains(unit), "{title}");
    }
}

/// Stresses on walls share a panel, with a level line at each target.
#[test]
fn targets_of_servos_are_drawn() {
    let walls = ["-x", "+x", "lid"].map(|name| plane_row(name, Vec3::zeros(), Vec3::x()));
    let walls_with_servo = ["-x", "+x", "gone"].map(str::to_owned).to_vec();
    let wall = StateColumn::new("wall", 1, "");
    let stresses = StateColumn::new("target", 1, "Pa");
    let columns = vec![
        SavedColumn::new(wall, Values::Texts(walls_with_servo)),
        SavedColumn::new(stresses, Values::Reals(vec![750.0, 750.0, 5e3])),
    ];
    let targets = servo::targets(&[SavedState { drive: "servos".into(), columns }]);
    assert_eq!(targets.len(), 3);
    let table = "time_s,stress_-x_Pa,stress_+x_Pa,stress_lid_Pa\n0,1,2,3\n1,640,650,900\n";
    let history = History::read(table.as_bytes()).unwrap();
    let plots = panels::panels(&history, &walls, &targets).unwrap();
    assert_eq!(plots.len(), 1);
    assert_eq!(plots[0].name, "history_wall_stresses");
    assert_eq!(plots[0].svg.matches("\ntarget 750 Pa\n").count(), 1);
    assert!(plots[0].svg.contains("lid") && !plots[0].svg.contains("target 5000 Pa"));
    // Three curves and one level line.
    let polylines = plots[0].svg.split("<polyline").skip(1);
    let points = polylines.filter_map(|text| {
        let (_, points) = text.split_once("points=\"")?;
        let ends = points.split_once('"')?.0.split_whitespace().map(|end| end.split_once(','));
        ends.collect::<Option<Vec<_>>>()
    });
    let curves: Vec<_> = points.filter(|ends| ends.len() == 2 && ends[0].0 != ends[1].0).collect();
    assert!(curves.iter().any(|ends| ends[0].1 == ends[1].1), "{}", plots[0].svg);
    let without = panels::panels(&history, &walls, &[]).unwrap();
    assert!(!without[0].svg.contains("target"));
}

#[test]
fn captions_tell_what_is_beyond_a_plot() {
    let captions = |forces: &[(f64, Vec3)]| {
        let (_, contacts) = contacts_with(&vec![Vec3::x(); forces.len()], forces);
        let header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
        let particles = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
        let forces = Snapshot { header, particles, contacts }.report().forces.unwrap();
        [
            plots::force_distribution(&forces.normal, &forces.shear).unwrap().caption,
            plots::friction(&forces.friction_used).unwrap().caption,
        ]
    };
    let mut forces = vec![(1.0, Vec3::zeros()); 21];
    assert!(captions(&forces).iter().all(|caption| !caption.contains("eyond")));
    // One force of 21 is twenty times the mean, and one contact uses more friction than its limit.
    forces[3].0 = 400.0;
    forces[7].1 = Vec3::z() * 1.5;
    let [distribution, friction] = captions(&forces);
    assert!(distribution.ends_with("at 8 times the mean and above: 4.762 % of the normal forces."));
    assert!(friction.ends_with("at 1 and above: 4.762 % of the contacts."), "{friction}");
    forces[3].1 = Vec3::z() * 200.0;
    let [distribution, _] = captions(&forces);
    assert!(
        distribution.ends_with("4.762 % of the normal forces, 4.762 % of the tangential forces.")
    );
}

/// A view of three balls of 1 m, in a box of this length by 4 m by 2 m.
fn view(name: &str, length: f64, change: impl FnOnce(&mut Snapshot)) -> String {
    let (low, high) = (Vec3::zeros(), Vec3::new(length, 4.0, 2.0));
    let places = [[2.3, 0.7, 1.6], [5.6, 3.1, 0.4], [5.2, 0.5, 0.7]].map(Vec3::from);
    let mut snapshot = Snapshot {
        header: header(low, high, false, Vec3::repeat(0.5), 3),
        particles: particles_at(places.to_vec()),
        contacts: ContactTable::default(),
    };
    change(&mut snapshot);
    let plots = views(&snapshot, &Bounds { low, high }).plots().unwrap();
    plots.into_iter().find(|plot| plot.name == name).expect("it is drawn").svg
}

/// Numbers of each path of a drawing, and the rest of its line.
fn paths(svg: &str) -> Vec<(Vec<f64>, &str)> {
    let paths = svg.lines().filter_map(|line| line.strip_prefix("<path d=\"")?.split_once('"'));
    let numbers = |path: &str| {
        let parts = path.split(|c: char| c == ' ' || c.is_alphabetic());
        parts.filter(|part| !part.is_empty()).map(|part| part.parse().unwrap()).collect()
    };
    paths.map(|(path, rest)| (numbers(path), rest)).collect()
}

/// Pixel position of a point in the side view: 14 pixels from the left and the top, 420 pixels long.
fn drawn_at(length: f64, x: f64, z: f64) -> [f64; 2] {
    [x, 2.0 - z].map(|metres| 14.0 + 420.0 / length * metres)
}

/// Checks pixels, which have one decimal digit.
fn close_pixels(found: &[f64], expected: [[f64; 2]; 2]) {
    for (found, expected) in found.iter().zip(expected.as_flattened()) {
        assert!((found - expected).abs() < 0.051, "{found} {expected}");
    }
}

/// Arrows about the middles of cells of 1 m: the fastest in the plane of the view has the length of a cell. A ball of eight times the mass has
/// eight times the weight.
#[test]
fn arrows_show_velocities_in_the_plane_of_the_view() {
    let svg = view("velocity_field", 8.0, |snapshot| {
        snapshot.particles.scale = vec![1.0, 1.0, 2.0];
        snapshot.particles.velocity =
            [[3.0, 50.0, 4.0], [0.0, -70.0, -9.0], [0.0, 9.0, -1.6875]].map(Vec3::from).to_vec();
    });
    let at = |x, z| drawn_at(8.0, x, z);
    let arrows = paths(&svg);
    assert_eq!(arrows.len(), 2);
    // By cells, the lowest row first: 2.5 m/s downwards, and 5 m/s.
    close_pixels(&arrows[0].0, [at(5.5, 0.75), at(5.5, 0.25)]);
    close_pixels(&arrows[1].0, [at(2.2, 1.1), at(2.8, 1.9)]);
    assert!(svg.contains("longest arrow: 5.000 m/s"), "{svg}");
}

/// Normal forces of 1 to 100 N: the third largest has the greatest width, a quarter of a particle within limits. Lines above the mean, 50.5 N,
/// are blue.
#[test]
fn chains_are_as_wide_as_normal_forces_are_large() {
    for (length, widest) in [(8.0, 6.0), (20.0, 5.25), (100.0, 1.5)] {
        let svg = view("force_chains", length, |snapshot| {
            for force in 1..=100 {
                let (centre, branch) =
                    (Vec3::new(1.0, 2.0, 0.01 * f64::from(force)), Vec3::new(0.5, 0.9, -0.25));
                push(&mut snapshot.contacts, (0, GlobalId(1)), centre, branch, 0.5 * branch);
                let shear = Vec3::y() * f64::from(500 - force);
                push_force(&mut snapshot.contacts, Vec3::x(), 1e-3, f64::from(force), shear);
            }
        });
        let lines = paths(&svg);
        assert_eq!(lines.len(), 100);
        for (force, (ends, style)) in (1..=100).map(f64::from).zip(lines) {
            let z = 0.01 * force;
            close_pixels(&ends, [[1.0, z], [1.5, z - 0.25]].map(|[x, z]| drawn_at(length, x, z)));
            let colour = if force > 50.5 { "#0072B2" } else { "#A9B2BC" };
            let words: Vec<&str> = style.split('"').collect();
            let (width, found) = (widest * (force / 98.0).min(1.0), words[3].parse::<f64>());
            assert_eq!((words[1], words[2]), (colour, " stroke-width="), "{force} N");
            // Widths have two decimal digits.
            let off = found.unwrap() - width.max(0.3);
            assert!(off.abs() < 0.0051, "{force} N: {style}, {width}");
        }
        assert!(svg.contains("mean 50.50 N, strongest 100.0 N"), "{svg}");
    }
}

/// The layers of a profile are complete: their means are the density and the stress of the whole packing.
#[test]
fn the_layers_of_a_profile_make_up_the_packing() {
    for seed in [8, 9] {
        let mut snapshot = ellipsoids(5, seed);
        // Deep enough that no particle reaches through the floor.
        let Header { cell, walls, .. } = &mut snapshot.header;
        let deeper = Vec3::z() * 2e-3;
        *cell = Cell::new(cell.corners().0 - deeper, cell.corners().1, [false; 3]);
        walls[0].point -= deeper;
        let report = snapshot.report();
        let layers = views(&snapshot, &report.bounds_m.unwrap()).profile.layers();
        assert!(layers.len() >= 4);
        let mean =
            |of: &dyn Fn(&Layer) -> f64| layers.iter().map(of).sum::<f64>() / layers.len() as f64;
        let solid = mean(&|layer| layer.solid_fraction) / report.summary.solid_fraction.unwrap();
        assert!((solid - 1.0).abs() < 1e-9, "{solid}");
        let Bounds { low, high } = report.bounds_m.unwrap();
        let middle = 2.0 * mean(&|layer| layer.height) / (low.z + high.z);
        assert!((middle - 1.0).abs() < 1e-9, "{middle}");
        let expected = report.stress_pa.unwrap().tensor;
        for k in 0..9 {
            let found = mean(&|layer| layer.stress[k]);
            assert!(
                (found - expected[k]).abs() < 1e-9 * expected.norm(),
                "{found} {}",
                expected[k]
            );
        }
    }
}

/// Layers of a region whose upright faces cut through contacts, on either side.
#[test]
fn the_layers_of_a_region_have_its_stress() {
    let snapshot = ellipsoids(5, 8);
    let whole = snapshot.report().bounds_m.unwrap();
    let middle = 0.37 * whole.low + 0.63 * whole.high;
    let (mut left, mut right, mut corner) = (whole, whole, whole);
    (left.high.x, right.low.x) = (middle.x, middle.x);
    (corner.low.x, corner.high.y) = (middle.x, middle.y);
    for region in [left, right, corner] {
        let settings = Settings { region: Region::Box(region), ..Settings::default() };
        let report = snapshot.analyse(settings).unwrap().report;
        let layers = views(&snapshot, &region).profile.layers();
        let sum: Mat3 = layers.iter().map(|layer| layer.stress).sum();
        let (found, expected) = (sum / layers.len() as f64, report.stress_pa.unwrap().tensor);
        assert!((found - expected).amax() < 1e-9 * expected.amax(), "{found} {expected}");
    }
}

/// A ball of radius 1 across layers: each layer has its segment of the ball.
#[test]
fn a_layer_has_the_segment_of_a_ball() {
    let (low, high) = (Vec3::zeros(), Vec3::repeat(4.0));
    let header = header(low, high, false, Vec3::repeat(1.0), 1);
    let snapshot = Snapshot {
        header,
        particles: particles_at(vec![Vec3::new(2.0, 2.0, 1.5)]),
        contacts: ContactTable::default(),
    };
    let layers = views(&snapshot, &Bounds { low, high }).profile.layers();
    assert_eq!(layers.len(), 4);
    let cap = |height: f64| std::f64::consts::PI * height * height * (3.0 - height) / 3.0;
    let all = cap(2.0);
    let expected = [cap(0.5), all - 2.0 * cap(0.5), cap(0.5), 0.0];
    let volume = snapshot.header.shapes[0].volume;
    for (layer, expected) in layers.iter().zip(expected) {
        let found = layer.solid_fraction * 16.0;
        assert!((found - expected * volume / all).abs() < 1e-12, "{found} {expected}");
    }
}

/// Layers of a box that is lower than the domain: periodic images count, and the weight above the box counts.
#[test]
fn layers_of_a_part_know_the_period_and_what_lies_above() {
    let high = Vec3::repeat(4.0);
    let part = Bounds { low: Vec3::zeros(), high: Vec3::new(4.0, 4.0, 2.0) };
    let cap = |height: f64| std::f64::consts::PI * height * height * (3.0 - height) / 3.0;
    for (periodic, z, inside) in
        [(true, 1.5, cap(2.0) - cap(0.5)), (true, 3.9, cap(0.9)), (false, 1.5, cap(2.0) - cap(0.5))]
    {
        let mut header = header(Vec3::zeros(), high, periodic, Vec3::repeat(1.0), 1);
        header.gravity = Vec3::new(0.0, 0.0, -10.0);
        let snapshot = Snapshot {
            header,
            particles: particles_at(vec![Vec3::new(2.0, 2.0, z)]),
            contacts: ContactTable::default(),
        };
        let layers = views(&snapshot, &part).profile.layers();
        let volume = layers.iter().map(|layer| 8.0 * layer.solid_fraction).sum::<f64>();
        assert!((volume - inside).abs() < 1e-12, "{periodic} {z}: {volume} {inside}");
        // In a bed the topmost layer carries the cap above it and half of itself.
        let weight = |volume: f64| snapshot.header.shapes[0].mass * volume / cap(2.0) * 10.0 / 16.0;
        let top = layers.last().unwrap();
        let above = if periodic { 0.0 } else { weight(cap(0.5)) };
        let expected = above + 0.5 * weight(cap(1.0) - cap(0.5)) * f64::from(u8::from(z < 2.0));
        assert!((top.weight_above - expected).abs() < 1e-12, "{} {expected}", top.weight_above);
    }
}
