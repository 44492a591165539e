"""Draws the grains of a run's last snapshot: gallery.py FOLDER PICTURE."""

import math
import sys
from pathlib import Path

import pyvista as pv
from PIL import Image, ImageChops

folder, picture = Path(sys.argv[1]), Path(sys.argv[2])
WIDTH = 560
COLOURS = ["#d9862b", "#3b77a8", "#7aa953", "#c4524e", "#8f6bb0"]

grains = pv.read(sorted((folder / "post").glob("grains_*.vtp"))[-1])
plotter = pv.Plotter(off_screen=True, window_size=(1500, 1500))
plotter.set_background("white")
plotter.add_mesh(
    grains,
    scalars="shape",
    cmap=COLOURS,
    show_scalar_bar=False,
    smooth_shading=True,
    split_sharp_edges=True,
    specular=0.25,
    ambient=0.18,
)
low, high = grains.bounds[::2], grains.bounds[1::2]
centre = [(a + b) / 2 for a, b in zip(low, high)]
size = math.dist(low, high)
eye = [centre[0] + 0.8 * size, centre[1] - 1.8 * size, centre[2] + 1.1 * size]
plotter.camera_position = [eye, centre, (0, 0, 1)]
plotter.enable_anti_aliasing("ssaa")
image = Image.fromarray(plotter.screenshot(return_img=True)).convert("RGB")

drawn = ImageChops.difference(image, Image.new("RGB", image.size, "white")).getbbox()
image = image.crop(drawn)
image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.LANCZOS)
image.quantize(128, dither=Image.Dither.FLOYDSTEINBERG).save(picture, optimize=True)
print(picture, image.size, picture.stat().st_size, "bytes")
