#!/usr/bin/env python3
"""Makes a template of plain solids, where the mean of a category's models is none: half of a closed, symmetric mesh of even
triangles, with texture coordinates.

  scripts/make_solid_template.py KIND TEMPLATE.obj

KIND is airplane, chair-legs, chair-armchair or chair-foot. The solids are united, rounded, cut at x = 0, and the half x >= 0 is
remeshed, as scripts/make_template.py does. Lengths are in diagonals; +Y is up, -Z the front. Needs:

  pip install numpy safetensors pymeshlab==2025.7.post1 trimesh==5.2.0 networkx shapely xatlas==0.0.11 manifold3d==3.5.4
"""
import sys

import numpy
import pymeshlab
import trimesh

from make_template import remeshed_half, write

CELL = 0.004


def hull(points):
    return trimesh.convex.convex_hull(numpy.array(points, float))


def box(low, high):
    corners = numpy.array([low, high], float)
    return hull([[corners[i][0], corners[j][1], corners[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def plate(corners, thickness, axis):
    """A flat solid with these corners in its middle."""
    half = numpy.zeros(3)
    half[axis] = thickness / 2
    corners = numpy.array(corners, float)
    return hull(numpy.vstack([corners + half, corners - half]))


def both_sides(corners, thickness, axis):
    return [plate(numpy.array(corners) * [side, 1, 1], thickness, axis) for side in (1, -1)]


def turned(rings, along):
    """A solid with round sections: (place along the axis, radius, the centre's y, or z where the axis is y)."""
    angles = numpy.linspace(0, 2 * numpy.pi, 48, endpoint=False)
    if along == "z":
        return hull([(r * numpy.cos(a), y + r * numpy.sin(a), z) for z, r, y in rings for a in angles])
    return hull([(r * numpy.cos(a), y, z + r * numpy.sin(a)) for y, r, z in rings for a in angles])


def seat_with_back():
    back = [(side * 0.19, y, z) for side in (-1, 1) for y, z in ((0, 0.165), (0, 0.225), (0.40, 0.19), (0.40, 0.25))]
    return [box((-0.20, -0.03, -0.225), (0.20, 0.03, 0.225)), hull(back)]


def airplane():
    fuselage = [
        (-0.40, 0.008, -0.035), (-0.385, 0.022, -0.032), (-0.35, 0.038, -0.026), (-0.30, 0.047, -0.022),
        (-0.25, 0.05, -0.02), (0.12, 0.05, -0.02), (0.25, 0.035, -0.008), (0.37, 0.010, 0.008),
    ]
    wing = [(0, -0.04, -0.10), (0, -0.04, 0.05), (0.35, -0.015, 0.09), (0.35, -0.015, 0.05)]
    tailplane = [(0, 0, 0.27), (0, 0, 0.36), (0.13, 0.01, 0.385), (0.13, 0.01, 0.345)]
    fin = [(0, 0, 0.20), (0, 0, 0.34), (0, 0.12, 0.38), (0, 0.12, 0.33)]
    return [turned(fuselage, "z"), *both_sides(wing, 0.02, 1), *both_sides(tailplane, 0.02, 1), plate(fin, 0.02, 0)]


def chair_on_legs():
    places = [(x * 0.165, z * 0.19) for x in (-1, 1) for z in (-1, 1)]
    return seat_with_back() + [box((x - 0.03, -0.40, z - 0.03), (x + 0.03, 0, z + 0.03)) for x, z in places]


def armchair():
    return [
        box((-0.29, -0.29, -0.27), (0.29, 0, 0.29)),
        box((-0.29, -0.29, 0.15), (0.29, 0.29, 0.29)),
        box((0.19, -0.29, -0.29), (0.29, 0.13, 0.29)),
        box((-0.29, -0.29, -0.29), (-0.19, 0.13, 0.29)),
    ]


def chair_on_a_foot():
    column = turned([(-0.38, 0.035, 0), (0, 0.035, 0)], "y")
    return [*seat_with_back(), column, turned([(-0.40, 0.22, 0), (-0.36, 0.20, 0)], "y")]


# What makes the solids, and the triangles' edge.
KINDS = {
    "airplane": (airplane, 0.009),
    "chair-legs": (chair_on_legs, 0.015),
    "chair-armchair": (armchair, 0.018),
    "chair-foot": (chair_on_a_foot, 0.015),
}


def main():
    if len(sys.argv) != 3 or sys.argv[1] not in KINDS:
        sys.exit(__doc__)
    solids, edge = KINDS[sys.argv[1]]
    united = trimesh.boolean.union(solids(), engine="manifold")
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(united.vertices, united.faces))
    meshes.generate_resampled_uniform_mesh(
        cellsize=pymeshlab.PureValue(CELL), offset=pymeshlab.PureValue(0), multisample=True, mergeclosevert=False
    )
    meshes.apply_coord_taubin_smoothing(stepsmoothnum=10)
    rounded = meshes.current_mesh()
    vertices, faces = remeshed_half(rounded.vertex_matrix(), rounded.face_matrix(), edge)
    write(sys.argv[2], vertices, faces)
    print(f"{sys.argv[2]}: {len(vertices)} vertices, {len(faces)} faces, half of the template")


main()
