"""Solid fraction and contacts of poured bodies of three balls: of a snapshot of dem-mpi, or of a dump of LIGGGHTS. Needs numpy and h5py.

    python3 pour.py out/unions_pour/last.vtkhdf end.txt ...

Solid fraction: share of points of a fine grid in the middle that are within a ball. Touching bodies: pairs of bodies with a ball in
a ball. Touching balls: pairs of balls of two bodies. Walls are left out.
"""

import json
import sys

import numpy as np

RADIUS, BALLS = 1e-3, 3
LOW, HIGH, SPACING = np.array([6e-3, 6e-3, 4e-3]), np.array([18e-3, 18e-3, 13e-3]), 1.5e-4


def turned(q, v):
    """Vector v turned by the quaternions (w, x, y, z), (n, 3)."""
    w, u = q[:, :1], q[:, 1:]
    return v + 2 * np.cross(u, np.cross(u, v) + w * v)


def of_snapshot(path):
    """Ball centres (n, 3) body by body, from a snapshot of dem-mpi."""
    import h5py

    with h5py.File(path) as file:
        x, q = file["/VTKHDF/Points"][:], file["/VTKHDF/PointData/quaternion"][:]
        shape = json.loads(file["/shapes/geometry"].asstr()[0])["Union"]
    return np.stack([x + turned(q, np.array(at)) for at in places(shape)], axis=1).reshape(-1, 3)


def places(shape):
    """Centres of the pieces in the principal axes of the union."""
    return [piece["centre"] for piece in shape["pieces"]]


def of_dump(path):
    """Ball centres (n, 3) body by body, from the last state of a dump of LIGGGHTS, whose ids follow the bodies."""
    lines = open(path).read().split("ITEM: ATOMS")[-1].splitlines()[1:]
    rows = np.array([[float(word) for word in line.split()[:4]] for line in lines])
    return rows[np.argsort(rows[:, 0]), 1:]


def solid_fraction(balls):
    points = np.stack(np.meshgrid(*[np.arange(a, b, SPACING) + SPACING / 2 for a, b in zip(LOW, HIGH)], indexing="ij"), -1).reshape(-1, 3)
    inside = np.zeros(len(points), bool)
    for ball in balls[np.all((balls > LOW - RADIUS) & (balls < HIGH + RADIUS), axis=1)]:
        inside |= np.sum((points - ball) ** 2, axis=1) < RADIUS**2
    return inside.mean()


def contacts(balls):
    """Touching bodies and touching balls, per body."""
    bodies = np.arange(len(balls)) // BALLS
    apart = np.linalg.norm(balls[:, None] - balls[None], axis=2)
    touch = (apart < 2 * RADIUS) & (bodies[:, None] != bodies[None])
    a, b = np.nonzero(touch)
    number = len(balls) // BALLS
    return len(set(zip(bodies[a], bodies[b]))) / number, len(a) / number


def main():
    print("file,solid_fraction,touching_bodies,touching_balls")
    for path in sys.argv[1:]:
        balls = of_snapshot(path) if path.endswith("hdf") else of_dump(path)
        spans = [np.linalg.norm(balls[k::BALLS] - balls[(k + 1) % BALLS :: BALLS], axis=1) for k in range(BALLS)]
        if max(np.ptp(span) for span in spans) > 1e-7:
            sys.exit(f"pour.py: {path}: the balls are not in the order of their bodies")
        bodies, pairs = contacts(balls)
        print(f"{path},{solid_fraction(balls):.4f},{bodies:.3f},{pairs:.3f}")


if __name__ == "__main__":
    main()
