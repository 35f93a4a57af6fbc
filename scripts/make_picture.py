#!/usr/bin/env python3
"""Makes docs/picture.png: three frames of the bundled sequence, the same with the solved shape, and the solved mesh from
three sides, the last of which no frame shows.

    spba-ceres solve data/sequences/car --prior car --out out/car
    pip install numpy pillow scipy trimesh
    scripts/make_picture.py data/sequences/car out/car docs/picture.png
"""

import sys
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

FRAMES = ["000", "004", "009"]
# Azimuth from the front towards +x and elevation, degrees.
SIDES = [(35, 20), (-40, 15), (-145, 18)]
CELL = (320, 240)
MESH_CELL = (320, 200)
# (left, top, right, bottom) of a frame, around the object.
CROP = (40, 36, 280, 216)
GAP = 6
# Pixels a diagonal of the object, and how much finer the mesh is drawn than shown.
SCALE = 330
FINER = 3
SAMPLES = 4_000_000
PAPER = 255
COLOURS = 160


def load_mesh(path):
    """Samples of the surface (object frame, units of the mesh), their normals and their colours in 0..255."""
    mesh = trimesh.load(path, force="mesh")
    points, faces = trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)
    corners = trimesh.triangles.points_to_barycentric(mesh.triangles[faces], points)
    uv = np.einsum("nk,nkc->nc", corners, mesh.visual.uv[mesh.faces[faces]])
    texture = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"), dtype=float)
    height, width, _ = texture.shape
    column = np.clip((uv[:, 0] * width).astype(int), 0, width - 1)
    row = np.clip(((1 - uv[:, 1]) * height).astype(int), 0, height - 1)
    normals = np.einsum("nk,nkc->nc", corners, mesh.vertex_normals[mesh.faces[faces]])
    centre = mesh.bounds.mean(axis=0)
    diagonal = np.linalg.norm(mesh.extents)
    return (points - centre) / diagonal, normals, texture[row, column]


def draw(points, normals, colours, azimuth, elevation):
    """The surface from far away, lit softly from the viewer so that its form shows where the texture is even."""
    a, e = np.radians([azimuth, elevation])
    towards = np.array([np.sin(a) * np.cos(e), np.sin(e), -np.cos(a) * np.cos(e)])
    right = np.cross([0, 1, 0], towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    width, height = MESH_CELL[0] * FINER, MESH_CELL[1] * FINER
    x = (width / 2 + SCALE * FINER * points @ right).astype(int)
    y = (height / 2 - SCALE * FINER * points @ up).astype(int)
    facing = normals @ towards / np.linalg.norm(normals, axis=1)
    shown = (x >= 0) & (x < width) & (y >= 0) & (y < height) & (facing > 0)
    pixel = y[shown] * width + x[shown]
    # Where several samples fall on a pixel, the last one written is the nearest.
    order = np.argsort((points @ towards)[shown], kind="stable")
    image = np.full((height * width, 3), float(PAPER))
    lit = colours[shown] * (0.55 + 0.45 * facing[shown, None])
    image[pixel[order]] = lit[order]
    picture = Image.fromarray(image.reshape(height, width, 3).astype(np.uint8))
    return picture.resize(MESH_CELL, Image.LANCZOS)


def main():
    sequence, result, out = map(Path, sys.argv[1:4])
    frame = lambda path: Image.open(path).convert("RGB").crop(CROP).resize(CELL, Image.LANCZOS)
    surface = load_mesh(result / "mesh.glb")
    rows = [
        [frame(sequence / "images" / f"{name}.png") for name in FRAMES],
        [frame(result / "overlay" / f"{name}.png") for name in FRAMES],
        [draw(*surface, *side) for side in SIDES],
    ]
    step = (CELL[0] + GAP, CELL[1] + GAP)
    sheet = Image.new("RGB", (3 * step[0] - GAP, 2 * step[1] + MESH_CELL[1]), (PAPER,) * 3)
    for j, row in enumerate(rows):
        for i, cell in enumerate(row):
            sheet.paste(cell, (i * step[0], j * step[1]))
    sheet.quantize(COLOURS, dither=Image.Dither.NONE).save(out, optimize=True)


if __name__ == "__main__":
    main()
