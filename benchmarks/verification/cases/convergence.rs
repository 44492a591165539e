//! Orders of convergence: closed forms and the reference over four step sizes, each half of the one before, and
//! LAMMPS beside them if it is installed.

use super::free_motion::Top;
use super::{
    Ball, Body, Case, Curve, Effort, Findings, Frame, Grain, Picture, Plane, Setup, decks,
    parse_reference,
};
use dem_mpi::math::{Quat, Vec3};
use std::f64::consts::{LN_2, PI};

const SOURCE: &str = "closed forms (this file) and independent reference (2026-11)";
const G: f64 = 9.81;

/// A number and its exact value.
type Pair = (f64, f64);

/// Errors of a run in this number of steps, with the names of the quantities.
type Errors = Box<dyn Fn(u64) -> Vec<(&'static str, f64)>>;

/// A motion with an exact solution.
struct Problem {
    name: &'static str,
    /// Expected order.
    order: f64,
    /// Reason why the order is not higher.
    why: &'static str,
    /// Steps of the coarsest run; the others have 2, 4 and 8 times as many.
    steps: u64,
    /// Errors of translation, rotation, or both.
    error: Errors,
    /// Order and errors with dashpots of second order, `foresee = true`.
    foreseen: Option<(f64, Errors)>,
    /// Errors of LAMMPS.
    of_lammps: Option<Errors>,
}

/// Cases for orders of convergence, and for the errors beside those of LAMMPS.
struct Orders {
    two: Case,
    one: Case,
    beside: Case,
    tops: Case,
}

impl Orders {
    fn new() -> Self {
        Self {
            two: Case::new(
                SOURCE,
                "smooth motion: order over four steps",
                "order of convergence (less than 2 counts)",
                0.1,
                "not yet asymptotic at the coarsest step",
            ),
            one: Case::new(
                SOURCE,
                "motion of first order by nature: dashpots with half-step velocities, Coulomb's slider",
                "order of convergence (less than 1 counts)",
                0.1,
                "not yet asymptotic at the coarsest step",
            ),
            beside: Case::new(
                "LAMMPS 29Sep2021 (Debian), decks written here",
                "error at the finest step",
                "error here against LAMMPS' (more counts)",
                0.1,
                "as good as LAMMPS or better",
            ),
            tops: Case::new(
                "LAMMPS 29Sep2021 (Debian), decks written here",
                "error of free tops at the finest step",
                "error here against LAMMPS' (more counts)",
                1.0,
                "another scheme of the same order: the midpoint rule keeps the energy to rounding",
            ),
        }
    }

    /// Adds the order of a quantity with these errors, and the reason of a first order.
    fn add(&mut self, what: &str, (expected, why): (f64, &str), steps: u64, errors: &[f64]) {
        let (order, finest) = (slope(errors), errors[3]);
        let scale = if order < expected { 1.0 } else { f64::INFINITY };
        let constant = finest * (steps << 3) as f64;
        let (case, row) = if expected == 2.0 {
            (&mut self.two, format!("{what} (error {finest:.1e})"))
        } else {
            (&mut self.one, format!("{what} (error {constant:.2e} / steps; {why})"))
        };
        case.over(scale, row, expected, order);
    }

    /// Adds errors beside those of LAMMPS.
    fn compare(&mut self, problem: &Problem, what: &str, own: &[f64], theirs: &[f64]) {
        let (finest, published) = (own[3], theirs[3]);
        let scale = if finest > published { published } else { f64::INFINITY };
        let is_top = problem.name.starts_with("top");
        let case = if is_top { &mut self.tops } else { &mut self.beside };
        let orders = format!("orders {:.2} LAMMPS, {:.2} here", slope(theirs), slope(own));
        case.over(scale, format!("{what} ({orders})"), published, finest);
    }
}

impl Problem {
    /// Steps of the four runs.
    fn all_steps(&self) -> [u64; 4] {
        [0, 1, 2, 3].map(|k| self.steps << k)
    }

    /// Errors of these runs, for each quantity.
    fn errors(
        &self,
        of: &dyn Fn(u64) -> Vec<(&'static str, f64)>,
    ) -> Vec<(&'static str, Vec<f64>)> {
        let all = self.all_steps().map(of);
        let quantity = |k: usize| (all[0][k].0, all.iter().map(|run| run[k].1).collect());
        (0..all[0].len()).map(quantity).collect()
    }

    /// Errors over steps, for a picture.
    fn points(&self, errors: &[f64]) -> Vec<(f64, f64)> {
        let over_coarsest = |n: u64| n as f64 / self.steps as f64;
        self.all_steps().into_iter().map(over_coarsest).zip(errors.iter().copied()).collect()
    }
}

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut findings = Findings::default();
    let mut orders = Orders::new();
    let with_lammps = effort == Effort::Full && decks::is_there();
    if !with_lammps {
        findings.notes.push(
            match effort {
                Effort::Quick => "LAMMPS is not run by the short cases.",
                Effort::Full => "LAMMPS (`lmp`) is not installed: its orders are left out.",
            }
            .to_owned(),
        );
    }
    for problem in problems() {
        let own = problem.errors(&*problem.error);
        let foreseen = problem.foreseen.as_ref().map(|(_, of)| problem.errors(&**of));
        let of_lammps = problem.of_lammps.as_ref().filter(|_| with_lammps);
        let theirs = of_lammps.map(|of| problem.errors(&**of));
        let mut curves = Vec::new();
        for (k, (quantity, errors)) in own.iter().enumerate() {
            let what = format!("{}: {quantity}", problem.name);
            orders.add(&what, (problem.order, problem.why), problem.steps, errors);
            let points = problem.points(errors);
            curves.push(Curve::new(format!("{what}, order {:.2}", slope(errors)), points));
            if let (Some((order, _)), Some(foreseen)) = (&problem.foreseen, &foreseen) {
                let errors = &foreseen[k].1;
                let named = format!("{what}, foreseen");
                orders.add(&named, (*order, PULLED_TO_THE_END), problem.steps, errors);
                let name = format!("with foresee = true, order {:.2}", slope(errors));
                curves.push(Curve::new(name, problem.points(errors)));
            }
            if let Some(theirs) = &theirs {
                let theirs = &theirs[k].1;
                orders.compare(&problem, &what, errors, theirs);
                let points = problem.points(theirs);
                curves.push(Curve::new(format!("LAMMPS, order {:.2}", slope(theirs)), points));
            }
        }
        findings.pictures.push(Picture {
            file: problem.name,
            axes: ["steps over those of the coarsest run", "error"],
            is_logarithmic: true,
            curves,
        });
    }
    findings.cases.extend([orders.two, orders.one]);
    if !orders.beside.rows.is_empty() {
        findings.cases.extend([orders.beside, orders.tops]);
    }
    findings
}

/// Order of errors at successively halved steps: slope of the least-squares line through their logarithms.
fn slope(errors: &[f64]) -> f64 {
    let points: Vec<Pair> =
        errors.iter().enumerate().map(|(k, e)| (k as f64, -e.ln() / LN_2)).collect();
    super::least_squares(&points).1
}

fn problems() -> Vec<Problem> {
    let mut all = vec![resting("ball_on_spring", 1.0), resting("ball_on_spring_and_dashpot", 0.5)];
    all.extend([collision("elastic_collision", 1.0), collision("damped_collision", 0.5)]);
    all.extend([sticking(), sliding(), oblique(), damped_flight(), rocking()]);
    all.extend((0..4).map(top));
    all
}

fn ball(restitution: f64) -> Ball {
    Ball {
        radius: 0.01,
        density: 2650.0,
        normal: 1e5,
        tangential: 8e4,
        friction: 0.3,
        restitution,
        pulls: true,
    }
}

fn off(pairs: &[Pair]) -> f64 {
    pairs.iter().map(|(found, exact)| (found - exact).abs()).fold(0.0, f64::max)
}

/// Initial state of a ball over the floor, for LAMMPS.
fn start(setup: &Setup) -> Body {
    let grain = &setup.grains[0];
    Body {
        position: grain.position,
        velocity: grain.velocity,
        orientation: grain.orientation,
        spin: grain.spin,
        angular_momentum: Vec3::zeros(),
        contacts: 0,
        mass: f64::NAN,
        rank: 0,
    }
}

const WITH_DASHPOT: &str = "the dashpot's force is of a velocity that is not that of the positions";

const PULLED_TO_THE_END: &str = "a contact that pulls at its end ends between two steps";

/// The setup with dashpots of second order.
fn foreseeing(mut setup: Setup) -> Setup {
    setup.text = setup.text.replacen("[law]", "[law]\nforesee = true", 1);
    setup
}

/// A ball that oscillates on its contact with the floor and never leaves it.
fn resting(name: &'static str, restitution: f64) -> Problem {
    let ball = ball(restitution);
    let (omega, z) = ((ball.normal / ball.mass()).sqrt(), ball.damping_ratio());
    let damped = omega * (1.0 - z * z).sqrt();
    let rest = ball.mass() * G / ball.normal;
    let end = 2.3 * 2.0 * PI / omega;
    let amplitude = 0.5 * rest;
    let setup = move |n: u64| {
        let dt = end / n as f64;
        let mut setup = ball.over_floor(-rest - amplitude, Vec3::zeros(), Vec3::zeros(), dt);
        setup.gravity = Vec3::new(0.0, 0.0, -G);
        setup
    };
    let error = move |body: &Body| {
        let (t, decay) = (end, z * omega);
        let (sin, cos) = (damped * t).sin_cos();
        let shrink = (-decay * t).exp();
        let height = -amplitude * shrink * (cos + decay / damped * sin);
        let velocity = amplitude * shrink * (damped + decay * decay / damped) * sin;
        let found = body.position.z - ball.radius + rest;
        vec![(
            "translation",
            off(&[
                (found / amplitude, height / amplitude),
                (body.velocity.z / (amplitude * omega), velocity / (amplitude * omega)),
            ]),
        )]
    };
    Problem {
        name,
        order: if restitution < 1.0 { 1.0 } else { 2.0 },
        why: WITH_DASHPOT,
        steps: 92,
        error: Box::new(move |n| error(&setup(n).run(n, n).pop().expect("an end").bodies[0])),
        foreseen: (restitution < 1.0).then(|| -> (f64, Errors) {
            let of = move |n| {
                let setup = foreseeing(setup(n));
                error(&setup.run(n, n).pop().expect("an end").bodies[0])
            };
            (2.0, Box::new(of))
        }),
        of_lammps: Some(Box::new(move |n| {
            let setup = setup(n);
            error(&decks::ball_on_floor(&ball, &start(&setup), G, setup.dt, n))
        })),
    }
}

/// A ball that hits the floor and leaves it: root mean square over eight times of touch within a step.
fn collision(name: &'static str, restitution: f64) -> Problem {
    let ball = ball(restitution);
    let speed = 0.5;
    let duration = ball.contact_time();
    let end = 1.5 * duration;
    let setup = move |n: u64, phase: u64| {
        let dt = end / n as f64;
        let gap = speed * dt * (phase as f64 + 0.5) / 8.0;
        (gap, ball.over_floor(gap, Vec3::z() * -speed, Vec3::zeros(), dt))
    };
    let error = move |gap: f64, body: &Body| {
        let fled = end - gap / speed - duration;
        let height = restitution * speed * fled;
        let size = speed * duration;
        off(&[
            ((body.position.z - ball.radius) / size, height / size),
            (body.velocity.z / speed, restitution),
        ])
    };
    let mean = move |of: &dyn Fn(u64) -> f64| {
        vec![("translation", ((0..8).map(|phase| of(phase).powi(2)).sum::<f64>() / 8.0).sqrt())]
    };
    Problem {
        name,
        order: if restitution < 1.0 { 1.0 } else { 2.0 },
        why: WITH_DASHPOT,
        steps: 60,
        error: Box::new(move |n| {
            mean(&|phase| {
                let (gap, setup) = setup(n, phase);
                error(gap, &setup.run(n, n).pop().expect("an end").bodies[0])
            })
        }),
        foreseen: (restitution < 1.0).then(|| -> (f64, Errors) {
            let of = move |n| {
                mean(&|phase| {
                    let (gap, setup) = setup(n, phase);
                    let frames = foreseeing(setup).run(n, n);
                    error(gap, &frames.last().expect("an end").bodies[0])
                })
            };
            (1.0, Box::new(of))
        }),
        of_lammps: Some(Box::new(move |n| {
            mean(&|phase| {
                let (gap, setup) = setup(n, phase);
                error(gap, &decks::ball_on_floor(&ball, &start(&setup), 0.0, setup.dt, n))
            })
        })),
    }
}

/// Exact motion along the floor of a ball on its static overlap. Its surface is held by a spring with a slider.
#[derive(Clone, Copy)]
struct Held {
    ball: Ball,
    /// Lever arm of the force about the centre [m].
    arm: f64,
    /// Initial velocity [m/s].
    velocity: f64,
}

impl Held {
    fn overlap(&self) -> f64 {
        self.ball.mass() * G / self.ball.normal
    }

    /// Position [m], velocity [m/s] and spin [rad/s] at a time [s].
    fn at(&self, time: f64) -> [f64; 3] {
        let (m, k) = (self.ball.mass(), self.ball.tangential);
        let inertia = 0.4 * m * self.ball.radius.powi(2);
        let softness = 1.0 / m + self.arm * self.arm / inertia;
        let omega = (k * softness).sqrt();
        let most = self.ball.friction * m * G / k;
        // Sticking from the start, sliding from `a`, sticking again from `b`: the spring, with its integral and
        // double integral until then.
        let a = if most * omega < self.velocity {
            (most * omega / self.velocity).asin() / omega
        } else {
            f64::INFINITY
        };
        let stick = |s: f64, u: f64, t: f64| {
            let (sin, cos) = (omega * t).sin_cos();
            let once = s * sin / omega + u * (1.0 - cos) / (omega * omega);
            let twice = s * (1.0 - cos) / (omega * omega) + u * (t - sin / omega) / (omega * omega);
            [s * cos + u * sin / omega, once, twice]
        };
        let slide = |t: f64| [most, most * t, 0.5 * most * t * t];
        let then = |before: [f64; 3], t: f64, phase: [f64; 3]| {
            [phase[0], before[1] + phase[1], before[2] + before[1] * t + phase[2]]
        };
        let first = |t: f64| stick(0.0, self.velocity, t);
        let [_, once, twice] = if time < a {
            first(time)
        } else {
            let at_a = first(a);
            let slip = self.velocity * (omega * a).cos();
            let b = a + slip / (most * k * softness);
            if time < b {
                then(at_a, time - a, slide(time - a))
            } else {
                let at_b = then(at_a, b - a, slide(b - a));
                then(at_b, time - b, stick(most, 0.0, time - b))
            }
        };
        [
            self.velocity * time - k / m * twice,
            self.velocity - k / m * once,
            k * self.arm / inertia * once,
        ]
    }

    fn error(&self, body: &Body, end: f64) -> Vec<(&'static str, f64)> {
        let [x, v, spin] = self.at(end);
        let way = self.velocity * end;
        let (found, size) = (body.spin.y, self.velocity / self.ball.radius);
        vec![
            (
                "translation",
                off(&[
                    (body.position.x / way, x / way),
                    (body.velocity.x / self.velocity, v / self.velocity),
                ]),
            ),
            ("rotation", off(&[(found / size, spin / size)])),
        ]
    }
}

/// A ball on the floor whose surface sticks, or slides in between.
fn held(name: &'static str, ball: Ball, velocity: f64, end: f64, steps: u64) -> Problem {
    let here = move |ball: Ball| {
        let overlap = ball.mass() * G / ball.normal;
        Held { ball, arm: ball.radius - 0.5 * overlap, velocity }
    };
    let setup = move |n: u64| {
        let mut setup = ball.over_floor(
            -here(ball).overlap(),
            Vec3::x() * velocity,
            Vec3::zeros(),
            end / n as f64,
        );
        setup.gravity = Vec3::new(0.0, 0.0, -G);
        setup
    };
    Problem {
        name,
        order: 2.0,
        why: "",
        steps,
        error: Box::new(move |n| {
            here(ball).error(&setup(n).run(n, n).pop().expect("an end").bodies[0], end)
        }),
        foreseen: None,
        of_lammps: Some(Box::new(move |n| {
            let setup = setup(n);
            let end_of = decks::ball_on_floor(&ball, &start(&setup), G, setup.dt, n);
            // The lever arm in LAMMPS is the radius.
            Held { arm: ball.radius, ..here(ball) }.error(&end_of, end)
        })),
    }
}

fn sticking() -> Problem {
    let ball = Ball { friction: 1e3, ..ball(1.0) };
    held("ball_that_sticks", ball, 1e-3, 2.3e-3, 92)
}

/// The surface sticks, slides from 0.04 % of the time on, and sticks again at the end.
fn sliding() -> Problem {
    held("ball_that_slides_and_sticks", ball(1.0), 0.01, 2.7e-3, 135)
}

/// MFIX' ball at 2.5 degrees, which slides at the beginning and the end of a contact: root mean square over four
/// times of touch within a step. The reference is an integration in 40,000 steps.
fn oblique() -> Problem {
    let (ball, degrees, speed) = (super::mfix::oxide_ball(1.0), 2.5, 3.9);
    let angle = f64::to_radians(degrees);
    let velocity = Vec3::new(speed * angle.sin(), 0.0, -speed * angle.cos());
    let end = 1.2 * ball.contact_time();
    let setup = move |n: u64, phase: u64| {
        let dt = end / n as f64;
        let gap = -velocity.z * dt * (phase as f64 + 0.5) / 4.0;
        ball.over_floor(gap, velocity, Vec3::zeros(), dt)
    };
    let errors = move |shorter: f64, of: &dyn Fn(u64) -> Body| {
        let exact = super::mfix::integrate(&ball, degrees, shorter);
        let mut sums = [0.0; 2];
        for phase in 0..4 {
            let body = of(phase);
            sums[0] += (body.velocity.x / velocity.x - exact[0]).powi(2) / 4.0;
            sums[1] += (body.spin.y / exact[1] - 1.0).powi(2) / 4.0;
        }
        vec![("translation", sums[0].sqrt()), ("rotation", sums[1].sqrt())]
    };
    Problem {
        name: "ball_thrown_at_2_5_degrees",
        order: 1.0,
        why: "Coulomb's slider cuts the spring once per step",
        steps: 60,
        error: Box::new(move |n| {
            errors(0.5, &|phase| setup(n, phase).run(n, n).pop().expect("an end").bodies.remove(0))
        }),
        foreseen: None,
        of_lammps: Some(Box::new(move |n| {
            errors(0.0, &|phase| {
                let setup = setup(n, phase);
                decks::ball_on_floor(&ball, &start(&setup), 0.0, setup.dt, n)
            })
        })),
    }
}

/// A body of equal axes in free fall with spin under global damping.
fn damped_flight() -> Problem {
    let (damping, end) = (3.0, 1.0);
    Problem {
        name: "flight_with_global_damping",
        order: 2.0,
        why: "",
        steps: 20,
        error: Box::new(move |n| {
            let setup = Setup {
                gravity: Vec3::new(0.0, 0.0, -G),
                text: "[[material]]\nname = \"m\"\ndensity = 1.0\nnormal_stiffness = 1e-9\n\
                       [[shape]]\nname = \"body\"\nkind = \"ellipsoid\"\nsemi_axes = [10, 10, 10]"
                    .to_owned(),
                planes: Vec::new(),
                grains: vec![
                    Grain::at("body", Vec3::zeros())
                        .moving(Vec3::x())
                        .spinning(Vec3::new(1.0, 2.0, 2.0)),
                ],
                dt: end / n as f64,
            };
            let scene = setup.scene_with(&format!("global_damping = {damping:e}"));
            let body = super::setup::run(&scene, n, n).pop().expect("an end").bodies.remove(0);
            let shrunk = (-damping * end).exp();
            let terminal = G / damping;
            vec![
                (
                    "translation",
                    off(&[
                        (body.position.x, (1.0 - shrunk) / damping),
                        (body.velocity.x, shrunk),
                        (body.position.z / terminal, -(end - (1.0 - shrunk) / damping)),
                        (body.velocity.z / terminal, shrunk - 1.0),
                    ]),
                ),
                ("rotation", off(&[(body.spin.norm() / 3.0, shrunk)])),
            ]
        }),
        foreseen: None,
        of_lammps: None,
    }
}

/// An ellipsoid that rocks with a large amplitude on a smooth floor: angle and height of the reference, and their
/// rates.
fn rocking() -> Problem {
    let reference = parse_reference("dem_rocking.json");
    let case = reference["cases"][0].clone();
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    let far = case["large_amplitude_frictionless"].clone();
    let row = 3;
    let at = move |key: &str, k: usize| far[key][k].as_f64().expect("a number");
    let inputs = &case["inputs"];
    let axes: Vec<f64> = (0..3).map(|k| number(&inputs["semi_axes"][k])).collect();
    let text = format!(
        "[[material]]\nname = \"m\"\ndensity = {:e}\nnormal_stiffness = {:e}\n\
         [[shape]]\nname = \"egg\"\nkind = \"ellipsoid\"\nsemi_axes = {axes:?}",
        number(&inputs["density"]),
        number(&inputs["kn"])
    );
    Problem {
        name: "ellipsoid_that_rocks",
        order: 2.0,
        why: "",
        steps: 500,
        error: Box::new(move |n| {
            let tilt = Quat::new(Vec3::y() * at("theta", 0));
            let setup = Setup {
                gravity: Vec3::new(0.0, 0.0, -G),
                text: text.clone(),
                planes: vec![Plane::floor("m")],
                grains: vec![Grain::at("egg", Vec3::z() * at("z", 0)).turned(tilt)],
                dt: at("t", row) / n as f64,
            };
            let Frame { bodies, .. } = setup.run(n, n).pop().expect("an end");
            let angle = 2.0 * bodies[0].orientation.imag().y.asin();
            vec![
                ("translation", off(&[(bodies[0].position.z / 0.01, at("z", row) / 0.01)])),
                (
                    "rotation",
                    off(&[
                        (angle, at("theta", row)),
                        (bodies[0].spin.y / 50.0, at("omega", row) / 50.0),
                    ]),
                ),
            ]
        }),
        foreseen: None,
        of_lammps: None,
    }
}

/// A free top of the reference, until 5 s.
fn top(which: usize) -> Problem {
    let names =
        ["top_about_largest", "top_about_smallest", "top_on_separatrix", "top_near_middle_axis"];
    let all = move |n: u64| {
        let top = Top::all(5.0 / n as f64).swap_remove(which);
        let row = *top.rows.iter().find(|row| row.0 == 5.0).expect("a row at 5 s");
        (top, row)
    };
    Problem {
        name: names[which],
        order: 2.0,
        why: "",
        steps: 500,
        error: Box::new(move |n| {
            let (top, row) = all(n);
            vec![(
                "rotation",
                Top::error(&top.setup.run(n, n).pop().expect("an end").bodies[0], &row),
            )]
        }),
        foreseen: None,
        of_lammps: Some(Box::new(move |n| {
            let (top, row) = all(n);
            let axes = Vec3::new(3.0, 2.0, 1.0);
            let body = decks::free_ellipsoid(&axes, &start(&top.setup), top.setup.dt, n);
            vec![("rotation", Top::error(&body, &row))]
        })),
    }
}
