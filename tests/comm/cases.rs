//! Requirements on every [`Comm`], whatever its implementation. All ranks call each function.

use dem_mpi::comm::{Comm, Parcel, Source};
use dem_mpi::ids::Rank;

/// Bytes specific to sender, receiver and round; their number varies, too, and may be zero.
fn bytes(from: Rank, to: Rank, round: u32) -> Vec<u8> {
    let length = (from.0 * 7 + to.0 * 3 + round) as usize % 5 * 1000;
    (0..length).map(|i| (i as u32 ^ (from.0 << 5) ^ (to.0 << 2) ^ round) as u8).collect()
}

fn everybody(comm: &dyn Comm) -> Vec<Rank> {
    (0..comm.size()).map(Rank).collect()
}

/// Parcels to and from all ranks, including oneself, of known and of unknown size. Work runs between start
/// and finish, and rounds do not mix.
pub(crate) fn exchange(comm: &mut dyn Comm) {
    let me = comm.rank();
    for round in 0..20 {
        let outgoing = everybody(comm)
            .into_iter()
            .map(|to| Parcel { rank: to, bytes: bytes(me, to, round) })
            .collect();
        // The order differs from that of the parcels sent.
        let sources: Vec<_> = everybody(comm)
            .into_iter()
            .rev()
            .map(|from| Source {
                rank: from,
                size: (from.0 + round).is_multiple_of(2).then(|| bytes(from, me, round).len()),
            })
            .collect();
        comm.start(outgoing, &sources);
        let expected: Vec<_> = sources
            .iter()
            .map(|s| Parcel { rank: s.rank, bytes: bytes(s.rank, me, round) })
            .collect();
        assert_eq!(comm.finish(), expected, "round {round}");
    }
    assert_eq!(comm.exchange(vec![], &[]), []);
}

/// Parcels without announced sources: two to the next rank, one to rank 0, some to oneself.
pub(crate) fn route(comm: &mut dyn Comm) {
    let (me, size) = (comm.rank(), comm.size());
    for round in 0..20 {
        let addressees = |from: u32| [(from + 1) % size, (from + 1) % size, 0].map(Rank);
        let outgoing = addressees(me.0)
            .into_iter()
            .enumerate()
            .map(|(k, to)| Parcel { rank: to, bytes: bytes(me, to, round + k as u32) })
            .collect();
        let expected: Vec<_> = (0..size)
            .flat_map(|from| {
                let all = addressees(from).into_iter().enumerate();
                all.filter(|&(_, to)| to == me).map(move |(k, to)| Parcel {
                    rank: Rank(from),
                    bytes: bytes(Rank(from), to, round + k as u32),
                })
            })
            .collect();
        assert_eq!(comm.route(outgoing), expected, "round {round}");
    }
    assert_eq!(comm.route(vec![]), []);
}

/// Sums, maxima and votes.
pub(crate) fn reductions(comm: &mut dyn Comm) {
    let (me, size) = (i64::from(comm.rank().0), i64::from(comm.size()));
    let mut values = [me, 1 << 40, -me, i64::from(me == 0) * i64::MAX];
    comm.sum(&mut values);
    let all = size * (size - 1) / 2;
    assert_eq!(values, [all, size << 40, -all, i64::MAX]);
    let mut values = [me as f64, -(me as f64), f64::NEG_INFINITY, 0.1];
    comm.max(&mut values);
    assert_eq!(values, [(size - 1) as f64, 0.0, f64::NEG_INFINITY, 0.1]);
    comm.sum(&mut []);
    comm.max(&mut []);
    assert!(comm.any(me == size - 1));
    assert!(!comm.any(false));
}

/// A vote runs beside parcels and counts in any order of completion; votes do not mix.
pub(crate) fn votes(comm: &mut dyn Comm) {
    let (me, size) = (comm.rank(), comm.size());
    for round in 0..50 {
        // Yes from no rank, from one rank, or from all but one.
        let yes = |rank: Rank| match round % 3 {
            0 => false,
            1 => rank.0 == round % size,
            _ => rank.0 != round % size,
        };
        comm.start_vote(yes(me));
        let outgoing = everybody(comm)
            .into_iter()
            .map(|to| Parcel { rank: to, bytes: bytes(me, to, round) })
            .collect();
        let sources: Vec<_> =
            everybody(comm).into_iter().map(|rank| Source { rank, size: None }).collect();
        for parcel in comm.exchange(outgoing, &sources) {
            assert_eq!(parcel.bytes, bytes(parcel.rank, me, round), "round {round}");
        }
        assert_eq!(comm.finish_vote(), everybody(comm).into_iter().any(yes), "round {round}");
        if round % 7 == 0 {
            assert!(comm.any(me.0 == 0));
        }
    }
}

/// A started sum of many values beside parcels; sums, votes and other reductions do not mix.
pub(crate) fn started_sums(comm: &mut dyn Comm) {
    let (me, size) = (i64::from(comm.rank().0), i64::from(comm.size()));
    let ranks = size * (size - 1) / 2;
    for round in 0..30_i64 {
        let count = [0, 1, 134, 5_000][round as usize % 4];
        comm.start_sum((0..count).map(|k| k * me + round - (1 << 40)).collect());
        let mut meanwhile = [me];
        comm.sum(&mut meanwhile);
        assert_eq!(meanwhile, [ranks]);
        let expected: Vec<i64> =
            (0..count).map(|k| k * ranks + size * (round - (1 << 40))).collect();
        assert_eq!(comm.finish_sum(), expected, "round {round}");
        assert!(comm.any(me == round % size));
    }
}

/// Broadcast from rank 0 to all ranks and gather to rank 0, with empty content, too.
pub(crate) fn broadcast_and_gather(comm: &mut dyn Comm) {
    let me = comm.rank();
    for length in [0, 1, 100_000] {
        let expected: Vec<u8> = (0..length).map(|i| (i * 31) as u8).collect();
        let mut found = if comm.is_root() { expected.clone() } else { vec![9; 3] };
        comm.broadcast(&mut found);
        assert_eq!(found, expected);
    }
    for round in 0..20 {
        let expected =
            everybody(comm).into_iter().map(|from| bytes(from, Rank(0), round)).collect();
        let gathered = comm.gather(bytes(me, Rank(0), round));
        assert_eq!(gathered, comm.is_root().then_some(expected), "round {round}");
    }
}
