//! Identical bits on any number of ranks.

use super::process::{Launch, dem_mpi};
use super::{
    HEAP_STEPS, assert_same_result, column, finished, fresh_directory, heap, report, scene,
};
use std::path::Path;

/// Walls, rain, friction, two shapes; particles migrate, and the cuts follow them.
#[test]
fn a_heap_has_the_same_bits_on_any_number_of_ranks() {
    let alone = heap(Launch::Alone);
    // The comparison is meaningful: many particles, most of them in contact at the end.
    assert!(column(&alone.directory, "particles")[&HEAP_STEPS] > 500.0);
    assert!(column(&alone.directory, "coordination")[&HEAP_STEPS] > 2.0);
    for ranks in [1, 2, 3, 4, 8] {
        let together = heap(Launch::Ranks(ranks));
        assert_same_result(&alone.directory, &together.directory);
        if ranks > 1 {
            let [rebuilt, cut, migrated] = traffic(&together.directory);
            assert!(rebuilt > 100 && cut > 3 && migrated > 100, "{}", together.ended);
        }
    }
}

/// No walls; two streams move through each other and through all borders.
#[test]
fn a_periodic_box_has_the_same_bits_on_any_number_of_ranks() {
    let alone = finished("periodic", Launch::Alone);
    let contacts = column(&alone.directory, "contacts");
    assert!(contacts.values().any(|&count| count > 50.0), "{contacts:?}");
    for ranks in [1, 2, 3] {
        let together = finished("periodic", Launch::Ranks(ranks));
        assert_same_result(&alone.directory, &together.directory);
        let [_, _, migrated] = traffic(&together.directory);
        assert!(ranks == 1 || migrated > 100, "{}", together.ended);
    }
}

/// Layers of rain in quick succession, so that the domain is cut again when one falls: its particles go to the new owners.
/// Without friction and dashpots ghosts have no velocities, and nothing dissipates.
#[test]
fn rain_falls_to_whom_the_new_cuts_give_it() {
    let alone = finished("shower", Launch::Alone);
    assert!(column(&alone.directory, "contacts").values().any(|&count| count > 50.0));
    assert!(column(&alone.directory, "dissipated_J").values().all(|&energy| energy == 0.0));
    for ranks in [2, 3] {
        let together = finished("shower", Launch::Ranks(ranks));
        assert_same_result(&alone.directory, &together.directory);
    }
}

/// The bed follows a wall far out of the domain, and the cuts follow the bed.
#[test]
fn cuts_follow_a_wall_out_of_the_domain() {
    let alone = finished("sinking", Launch::Alone);
    assert!(column(&alone.directory, "place_-z_m").values().any(|&place| place < -0.02));
    for ranks in [2, 3] {
        let together = finished("sinking", Launch::Ranks(ranks));
        assert_same_result(&alone.directory, &together.directory);
    }
}

/// An inlet, an outlet, a size distribution, and an oscillating wall of triangles, also with a restart on other numbers of
/// ranks.
#[test]
fn what_comes_and_goes_over_triangles_has_the_same_bits() {
    let alone = finished("chute", Launch::Alone);
    let left = column(&alone.directory, "left_below");
    assert!(left.values().any(|&count| count > 200.0), "{left:?}");
    assert!(column(&alone.directory, "wall_contacts").values().any(|&count| count > 10.0));
    for ranks in [2, 3, 4, 8] {
        let together = finished("chute", Launch::Ranks(ranks));
        assert_same_result(&alone.directory, &together.directory);
    }
    let directory = fresh_directory("chute_in_legs");
    let scene = scene("chute");
    let words = |rest: &[&str]| {
        let all = [&*scene, "--out", directory.to_str().unwrap()];
        all.iter().chain(rest).map(|&word| word.to_owned()).collect::<Vec<_>>()
    };
    dem_mpi(Launch::Ranks(2), words(&["--steps", "7010"])).succeed();
    let start = ["--start", directory.to_str().unwrap()];
    dem_mpi(Launch::Ranks(3), words(&start)).succeed();
    assert_same_result(&alone.directory, &directory);
}

/// Contacts that persist beyond their overlap, also across the borders of ranks and of the period.
#[test]
fn what_sticks_has_the_same_bits_on_any_number_of_ranks() {
    let alone = finished("sticky", Launch::Alone);
    assert!(column(&alone.directory, "contacts").values().any(|&count| count > 200.0));
    for ranks in [2, 3, 4] {
        let together = finished("sticky", Launch::Ranks(ranks));
        assert_same_result(&alone.directory, &together.directory);
    }
}

/// Numbers of rebuilt pair lists, of new cuts, and of migrated particles.
fn traffic(directory: &Path) -> [u64; 3] {
    let report = report(directory);
    ["rebuilds", "recuts", "migrated"].map(|key| report["ranks"][key].as_u64().unwrap())
}

/// Bodies of several pieces, of balls and of blocks, also with a restart on other numbers of ranks.
#[test]
fn bodies_of_pieces_have_the_same_bits() {
    let alone = finished("unions", Launch::Alone);
    let contacts = column(&alone.directory, "contacts");
    assert!(contacts.values().any(|&count| count > 50.0), "{contacts:?}");
    for ranks in [2, 3, 4] {
        let together = finished("unions", Launch::Ranks(ranks));
        assert_same_result(&alone.directory, &together.directory);
        let [_, _, migrated] = traffic(&together.directory);
        assert!(migrated > 20, "{}", together.ended);
    }
    let directory = fresh_directory("unions_in_legs");
    let scene = scene("unions");
    let words = |rest: &[&str]| {
        let all = [&*scene, "--out", directory.to_str().unwrap()];
        all.iter().chain(rest).map(|&word| word.to_owned()).collect::<Vec<_>>()
    };
    dem_mpi(Launch::Ranks(2), words(&["--steps", "7010"])).succeed();
    let start = ["--start", directory.to_str().unwrap()];
    dem_mpi(Launch::Ranks(3), words(&start)).succeed();
    assert_same_result(&alone.directory, &directory);
}
