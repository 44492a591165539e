//! Particles at random positions without contact.

use crate::support::scene;
use dem_mpi::math::Vec3;
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::{Scene, packing};
use std::path::Path;

/// Particles of the scene of these tests, with changed keys.
fn particles(changes: &[&str]) -> (Scene, Vec<Particle>) {
    let changes: Vec<String> = changes.iter().map(|&change| change.to_owned()).collect();
    let scene = Scene::read(Path::new("tests/scenes/good/scattered.toml"), &changes).unwrap();
    let all = packing::initial(&scene).collect();
    (scene, all)
}

#[test]
fn no_bounding_balls_touch_and_the_amount_is_as_asked() {
    let (scene, all) = particles(&[]);
    let radius = |p: &Particle| scene.library.radius[p.shape.index()] * p.scale;
    let volume = |p: &Particle| scene.library.shapes[p.shape.index()].volume() * p.scale.powi(3);
    for (k, one) in all.iter().enumerate() {
        for other in &all[..k] {
            let apart = scene.domain.nearest(other.position - one.position).norm();
            assert!(apart > radius(one) + radius(other), "{} and {}", one.id, other.id);
        }
        assert!(one.position.z > radius(one) && one.position.z < 0.12 - radius(one));
        assert!(one.position.x >= 0.0 && one.position.x < 0.1);
    }
    // The last particle exceeds the fraction.
    let (first, second) = all.split_at(all.len() - 20);
    let share = first.iter().map(volume).sum::<f64>() / (0.1 * 0.08 * 0.1);
    let largest = first.iter().map(volume).fold(0.0, f64::max) / (0.1 * 0.08 * 0.1);
    assert!(share >= 0.12 && share < 0.12 + largest, "{share}");
    assert!(first.iter().all(|p| p.position.z > 0.02 && p.velocity == Vec3::z() * 0.1));
    assert!(second.iter().all(|p| p.shape.index() == 1));
    let of_eggs: f64 = first.iter().filter(|p| p.shape.index() == 1).map(volume).sum();
    let of_all: f64 = first.iter().map(volume).sum();
    // A third by mass, among some hundred particles.
    assert!((of_eggs / of_all - 1.0 / 3.0).abs() < 0.1, "{}", of_eggs / of_all);
}

/// Centres in a periodic box are uniform: each of eight octants has an eighth.
#[test]
fn places_are_even_and_follow_the_seed() {
    let text = |seed: u32| {
        scene(&format!(
            "seed = {seed}\n[domain]\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\nperiodic = [true, true, true]\n\
             [[material]]\nname = \"m\"\ndensity = 1000\nnormal_stiffness = 1e4\n\
             [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.01\n[[fill.random]]\ncount = 8000\n"
        ))
    };
    let places = |seed| packing::initial(&text(seed)).map(|p| p.position).collect::<Vec<_>>();
    let (one, again, other) = (places(1), places(1), places(2));
    assert!(one == again && one.iter().zip(&other).all(|(a, b)| a != b));
    for octant in 0..8 {
        let is_in = |p: &&Vec3| (0..3).all(|axis| (p[axis] > 0.5) == (octant >> axis & 1 == 1));
        let count = one.iter().filter(is_in).count() as f64;
        // Four standard deviations of independent positions.
        assert!((count - 1000.0).abs() < 120.0, "{octant}: {count}");
    }
}
