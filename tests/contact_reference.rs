//! Contact resolution against answers computed with 50 digits: `tests/reference/README.md`.

use dem_mpi::contact::{ContactResolver, Method, Outcome, Posed, Touch, table};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::shape::{Ellipsoid, Kind, Shape, Sphere};

/// A pair of bodies and what is known of it.
struct Case {
    id: String,
    tag: String,
    a: Shape,
    b: Shape,
    frame_a: Mat3,
    frame_b: Mat3,
    r: Vec3,
    overlap: f64,
    normal: Vec3,
    point: Vec3,
    kappa: f64,
    rho: f64,
    unique: bool,
    size: f64,
}

fn read(csv: &str) -> impl Iterator<Item = impl Fn(&str) -> String> {
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let header = reader.headers().unwrap().clone();
    let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
    rows.into_iter().map(move |row| {
        let header = header.clone();
        move |name: &str| {
            let column = header.iter().position(|h| h == name);
            row[column.unwrap_or_else(|| panic!("no column {name}"))].to_string()
        }
    })
}

fn cases(csv: &str) -> Vec<Case> {
    let far = csv.lines().next().unwrap().contains("rAx");
    read(csv).map(|text| {
        let number = |name: &str| text(name).parse::<f64>().unwrap();
        let vector = |start: &str, end: &str| Vec3::from_fn(|i, _| number(&format!("{start}{}{end}", ["x", "y", "z"][i])));
        let semi = |body: &str| Vec3::from_fn(|i, _| number(&format!("{}{body}", ["a", "b", "c"][i])));
        let frame = |body: &str| {
            let q = ["w", "x", "y", "z"].map(|c| number(&format!("q{c}{body}")));
            Quat::from_quaternion(nalgebra::Quaternion::new(q[0], q[1], q[2], q[3])).to_rotation_matrix().into_inner()
        };
        let centre = |body: &str| Vec3::from_fn(|i, _| number(&format!("{}{body}", ["x", "y", "z"][i])));
        let r = centre("B") - centre("A");
        let point = if far { (vector("rA", "") + (r + vector("rB", ""))) * 0.5 } else { vector("C", "") - centre("A") };
        Case {
            id: text("id"),
            tag: text("tag"),
            a: Shape::Ellipsoid(Ellipsoid { semi_axes: semi("A") }),
            b: Shape::Ellipsoid(Ellipsoid { semi_axes: semi("B") }),
            frame_a: frame("A"),
            frame_b: frame("B"),
            r,
            overlap: number("overlap"),
            normal: vector("n", ""),
            point,
            kappa: number("kappa"),
            rho: number("rho"),
            unique: text("unique") == "1",
            size: semi("A").max().max(semi("B").max()),
        }
    }).collect()
}

impl Case {
    fn resolve(&self, resolver: &dyn ContactResolver, warm: Option<&Vec3>) -> Outcome {
        let a = Posed { shape: &self.a, frame: &self.frame_a };
        let b = Posed { shape: &self.b, frame: &self.frame_b };
        resolver.touch(&a, &b, &self.r, warm)
    }
}

#[test]
fn explore() {
    use dem_mpi::contact::{CommonNormal, Epa, ErodedGjk};
    for (name, text) in [("I", include_str!("reference/caseI.csv")), ("II", include_str!("reference/caseII.csv")), ("III", include_str!("reference/caseIII_public.csv")), ("X", include_str!("reference/extreme_public.csv"))] {
        let all = cases(text);
        let resolvers: [(&str, Box<dyn ContactResolver>); 5] = [("cn", Box::new(CommonNormal)), ("epa8", Box::new(Epa{tolerance:1e-8})), ("epa12", Box::new(Epa{tolerance:1e-12})), ("gjk", Box::new(ErodedGjk::default())), ("gjk-tight", Box::new(ErodedGjk{tolerance:1e-14, ..ErodedGjk::default()}))];
        for (rn, res) in &resolvers {
            let mut worst = [0.0f64; 3];
            let mut bad = 0;
            for c in &all {
                match c.resolve(&**res, None) {
                    Outcome::Apart => if c.overlap > 1e-13 * c.size { bad += 1; println!("{name} {rn} {} {} MISSED {:e}", c.id, c.tag, c.overlap) },
                    Outcome::Failed(why) => { bad += 1; println!("{name} {rn} {} {} {why:?} {:e}", c.id, c.tag, c.overlap / c.size) }
                    Outcome::Touching(t) => {
                        let eo = (t.overlap - c.overlap).abs() / c.size;
                        let en = t.normal.cross(&c.normal).norm().atan2(t.normal.dot(&c.normal)) / (1e-13 * c.size / c.kappa + 1e-15);
                        let ep = (t.point - c.point).norm() / (1e-13 * c.size * (1.0 + c.rho / c.kappa));
                        worst[0] = worst[0].max(eo);
                        if c.unique { worst[1] = worst[1].max(en); worst[2] = worst[2].max(ep); }
                        if *rn == "cn" && (eo > 1e-13 || (c.unique && (en > 1.0 || ep > 1.0))) {
                            println!("{name} {rn} {} {} overlap {:e} err {eo:e} n {en:e} C {ep:e} kappa {:e}", c.id, c.tag, c.overlap/c.size, c.kappa/c.size);
                        }
                        if rn.starts_with("epa") && eo > 1.1e-8 { println!("{name} {rn} {} {} overlap {:e} err {eo:e}", c.id, c.tag, c.overlap/c.size); }
                    }
                }
            }
            println!("{name} {rn}: bad {bad} of {}; worst {worst:?}", all.len());
        }
    }
    let exact: Vec<_> = read(include_str!("reference/caseIII_erosion05_public.csv")).collect();
    let all = cases(include_str!("reference/caseIII_public.csv"));
    for tol in [1e-3, 1e-4, 1e-6, 1e-10, 1e-14] {
        let e = ErodedGjk { tolerance: tol, ..ErodedGjk::default() };
        let mut errs = [vec![], vec![], vec![]];
        for row in &exact {
            let c = all.iter().find(|c| c.id == row("id")).unwrap();
            let f = |n: &str| row(n).parse::<f64>().unwrap();
            let Outcome::Touching(t) = c.resolve(&e, None) else { println!("{} not touching", c.id); continue };
            errs[0].push((t.overlap - f("overlap_erosion")).abs());
            let n = Vec3::new(f("nx"), f("ny"), f("nz"));
            errs[1].push(t.normal.cross(&n).norm().atan2(t.normal.dot(&n)));
            errs[2].push((t.point - Vec3::new(f("Cx"), f("Cy"), f("Cz"))).norm());
        }
        for e in &mut errs { e.sort_by(f64::total_cmp); }
        println!("erosion tol {tol:e}: {:?}", errs.map(|e| (e[e.len()/2], e[e.len()*99/100], e[e.len()-1])));
    }
}
