"""The public data of Dosta et al. (2024), doi 10.1016/j.cpc.2023.109066, as the scenes of these records read them. Python alone is enough.

    python3 benchmarks/records/dem8.py PARTICLES grains.csv          radius x y z of each sphere, or x y z (then all are M1)
    python3 benchmarks/records/dem8.py WALLS drum.obj                nine numbers of each triangle: its corners

The data are of doi 10.5281/zenodo.8252892; MercuryDPM has a copy (Drivers/Papers/OSBenchmark), of which the records took theirs: metres, z up.
Of it Drum/PartCoordinates.txt and Drum/walls.txt are the drum, Silo/walls (large orifice).txt and Silo/walls (small orifice).txt the silos.
Numbers stand apart by blanks or commas, words before them are passed over, *.gz is unpacked. It tells whether what it wrote is what the records read.
"""

import gzip
import hashlib
import sys
from pathlib import Path

# The sha256 of what the records read.
KNOWN = {
    "582f1cdb25c4e7c061a48580b8038161b644be30cc07726a2dec3b66a5da7a6e": "grains.csv of the drum",
    "de50c9ccff1c09e63e2f4ca8fdcdf0e0afe32236c833ceda0d88b36c15a9f01d": "drum.obj",
    "4c65d67bc788a53da818b39f23b2c7f7bca99738e101210c617b0549cace369f": "large.obj of the silo",
    "c624377e2021c03728644f21068c678e521b0b9679e77b2360e2be12b1d0d5d0": "small.obj of the silo",
}


def rows(path):
    """Lists of numbers, all of one length."""
    data = path.read_bytes()
    text = (gzip.decompress(data) if path.suffix == ".gz" else data).decode()
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.replace(",", " ").split()
        try:
            [float(word) for word in words]
        except ValueError:
            if found:
                sys.exit(f"dem8.py: {path}:{number}: {line.strip()}: a line of words among numbers")
            continue
        if words:
            if len(words) != len((found or [words])[0]):
                sys.exit(f"dem8.py: {path}:{number}: {len(words)} numbers, where the first line has {len(found[0])}")
            found.append(words)
    if not found:
        sys.exit(f"dem8.py: {path}: no numbers")
    return found


def grains(lines):
    """A file of [[fill.file]]: M1 has a radius of 1 or 2 mm, M2 beside it one of 2 mm."""
    radii = sorted({float(line[0]) for line in lines}) if len(lines[0]) == 4 else [0.0]
    if len(radii) > 2:
        sys.exit(f"dem8.py: spheres of {len(radii)} radii, from {radii[0]} to {radii[-1]} m")
    names = dict(zip(radii, ["m1", "m2"]))
    # As they are written: no digit is lost.
    named = [(names[float(line[0])] if len(line) == 4 else "m1", line[-3:]) for line in lines]
    return "shape,x,y,z\n" + "".join(f"{name},{','.join(place)}\n" for name, place in named)


def surface(lines):
    """An OBJ file: each corner once, triangles as they follow."""
    places = {}
    faces = [[places.setdefault(tuple(line[k : k + 3]), len(places) + 1) for k in (0, 3, 6)] for line in lines]
    return "".join(f"v {' '.join(place)}\n" for place in places) + "".join("f {} {} {}\n".format(*face) for face in faces)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__.strip())
    source, target = map(Path, sys.argv[1:])
    lines = rows(source)
    kinds = {3: grains, 4: grains, 9: surface}
    if len(lines[0]) not in kinds:
        sys.exit(f"dem8.py: {source}: {len(lines[0])} numbers in a line: 3 or 4 are spheres, 9 triangles")
    text = kinds[len(lines[0])](lines)
    target.write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    print(f"{target}: {len(lines):,} {'triangles' if len(lines[0]) == 9 else 'spheres'}, {KNOWN.get(digest, 'not a file of the records')}, sha256 {digest}")
