"""Height of the column and of the heap, of balls or of jacks: top of the highest body and median distance from the axis. Needs numpy and h5py.

    python3 heap.py out/balls/last.vtkhdf ...
"""

import sys

import h5py
import numpy as np

ARM, ROUND, BALL = 0.01, 0.0025, 0.006588  # m: half the length of an arm, its radius, the radius of a ball


def reach(quaternions):
    """How far jacks reach up from their centres (n,): z of the three turned axes, of which the largest counts."""
    w, x, y, z = quaternions.T
    axes = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    return ARM * np.abs(axes).max(axis=0) + ROUND


def main():
    print("file,bodies,top_mm,median_distance_mm")
    for path in sys.argv[1:]:
        with h5py.File(path) as file:
            x, data = file["/VTKHDF/Points"][:], file["/VTKHDF/PointData"]
            shape = file["/shapes/name"].asstr()[data["shape"][0]]
            up = x[:, 2] + (reach(data["quaternion"][:]) if shape == "jack" else BALL)
        print(f"{path},{len(x)},{1e3 * up.max():.1f},{1e3 * np.median(np.hypot(x[:, 0], x[:, 1])):.1f}")


if __name__ == "__main__":
    main()
