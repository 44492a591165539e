//! Scenes with many materials: constants like with few, and memory that grows with their number, not with that of their pairs.

use crate::support::scene;
use dem_mpi::ids::MaterialId;
use dem_mpi::law::linear::damping_ratio_of_restitution;
use dem_mpi::law::stability::Partner;
use dem_mpi::scene::Scene;
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::plan::plan;
use std::fmt::Write;
use std::path::Path;

/// Scene of `count` materials with a ball of each. Every other one has no friction key if `silent`.
fn text(count: u32, silent: bool) -> String {
    let mut text = "[domain]\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\n".to_owned();
    let mut names = Vec::new();
    for k in 0..count {
        let friction = if silent && k % 2 == 1 {
            String::new()
        } else {
            format!("friction = 0.{}\n", 1 + k % 9)
        };
        write!(
            text,
            "[[material]]\nname = \"m{k}\"\ndensity = 2500\nnormal_stiffness = {}\nrestitution = 0.{}\n{friction}\
             [[shape]]\nname = \"s{k}\"\nmaterial = \"m{k}\"\nkind = \"sphere\"\nradius = 0.01\n",
            stiffness(k),
            1 + k % 7
        )
        .unwrap();
        names.push(format!("\"s{k}\""));
    }
    let last = count - 1;
    write!(
        text,
        "[[interaction]]\nbetween = [\"m{last}\", \"m1\"]\nfriction = 0.75\n\
         [[fill.lattice]]\nshapes = [{}]\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\n[time]\nstep = 1e-6\n",
        names.join(", ")
    )
    .unwrap();
    text
}

/// Stiffness of a contact between two bodies of the material [N/m].
fn stiffness(k: u32) -> f64 {
    f64::from(10_000 + 7 * k)
}

#[test]
fn constants_of_many_materials_are_mixed_as_of_few() {
    for count in [5, 64, 65, 300] {
        let scene = scene(&text(count, false));
        let constants = &scene.law.linear().expect("linear contacts").interactions;
        let last = count - 1;
        for (a, b) in [(0, 0), (0, 3), (3, 0), (2, last), (last, last), (1, last), (last, 1)] {
            let of = constants.of(MaterialId(a as u16), MaterialId(b as u16));
            let [one, other] = [a, b].map(stiffness);
            let harmonic = 2.0 * one * other / (one + other);
            assert!((of.normal_stiffness / harmonic - 1.0).abs() < 1e-15, "{count} {a} {b}");
            let friction = [a, b].map(|k| f64::from(1 + k % 9) / 10.0);
            let set = (a.min(b), a.max(b)) == (1, last);
            let expected = if set { 0.75 } else { friction[0].min(friction[1]) };
            assert_eq!(of.friction, expected, "{count} {a} {b}");
            let ratios =
                [a, b].map(|k| damping_ratio_of_restitution(f64::from(1 + k % 7) / 10.0, true));
            let mean = 0.5 * (ratios[0] + ratios[1]);
            assert!((of.normal_damping_ratio - mean).abs() < 1e-15, "{count} {a} {b}");
        }
        assert_eq!(constants.iter().count() as u32, count * (count + 1) / 2);
        // The stiffest partner counts most, however many materials precede it.
        let limit = scene.time_step_limit().expect("balls that touch");
        let [one, other] = [u32::from(limit.shape.0), last].map(stiffness);
        let harmonic = 2.0 * one * other / (one + other);
        assert_eq!(limit.partner, Partner::Particles(MaterialId(last as u16)));
        assert!((limit.stiffness / harmonic - 1.0).abs() < 1e-14, "{limit:?} {harmonic}");
    }
}

/// A scene travels between ranks as bytes, in proportion to its materials and not to their pairs.
#[test]
fn a_scene_grows_with_its_materials() {
    let bytes = |count| {
        let scene = scene(&text(count, true));
        dem_mpi::comm::wire::encode(&scene.law).len() as f64
    };
    let [few, many] = [200, 800].map(bytes);
    assert!(many < 4.5 * few, "{few} {many}");
}

/// Lists of names end after some tens, and warnings after some pairs.
#[test]
fn what_is_said_of_many_is_short() {
    let given = text(300, true);
    let silent = scene(&given);
    let all = doubts(&silent);
    let pairs: Vec<_> = all.iter().filter(|doubt| doubt.starts_with("between materials")).collect();
    assert_eq!(pairs.len(), 20, "{all:?}");
    // 150 materials have the key and 150 do not; one pair has an interaction with it.
    let one_more = format!("the same applies to {} more pairs of materials", 150 * 150 - 20);
    assert!(all.contains(&one_more), "{all:?}");
    let plan = plan(&silent, 1);
    let of_shapes = plan.lines().filter(|line| line.trim_start().starts_with("shape ")).count();
    assert!(of_shapes == 50 && plan.contains("and 250 more shapes"), "{plan}");
    assert!(plan.lines().all(|line| line.len() < 2500), "{plan}");

    let walls = given
        .replace("high = [1, 1, 1]\n[[material", "high = [1, 1, 1]\nwalls = [\"-z\"]\n[[material");
    let refused = Scene::parse(&walls, "scene.toml", Path::new(""), &[]).unwrap_err().to_string();
    assert!(refused.contains("`wall_material` is missing: one of m0, m1, "), "{refused}");
    assert!(refused.contains(" and 280 more") && refused.len() < 1000, "{refused}");
}
