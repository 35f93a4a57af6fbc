#!/usr/bin/env python3
"""Makes the template of a prior of surfaces: half of a closed, symmetric mesh of even triangles, with texture coordinates.

  scripts/make_template.py PRIOR.safetensors TEMPLATE.obj [EDGE]

PRIOR is a prior of points (schema 1): its mean shape with normals is what the template looks like. EDGE is the triangles' edge in
diagonals (0.015 unless given). The surface comes from screened Poisson reconstruction; closing (0.014) and opening (0.010) take tunnels
and thin parts away, so that it is a sphere bent; it is then cut at x = 0, and the half x >= 0 is remeshed. Texture coordinates
fill the left half of the picture; the right half is the mirror image's. Needs:

  pip install numpy safetensors pymeshlab==2025.7.post1 trimesh==5.2.0 networkx shapely xatlas==0.0.11
"""
import sys

import numpy
import pymeshlab
import trimesh
import xatlas
from safetensors import safe_open

CELL, CLOSING, OPENING = 0.006, 0.014, 0.010
MIRROR = numpy.array([-1.0, 1.0, 1.0])


def points_of(path):
    with safe_open(path, "numpy") as file:
        mean, normals = (file.get_tensor(name).astype(float) for name in ("mean", "normals"))
    return numpy.vstack([mean, mean * MIRROR]), numpy.vstack([normals, normals * MIRROR])


def closed_surface(points, normals):
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=points, v_normals_matrix=normals))
    meshes.generate_surface_reconstruction_screened_poisson(depth=7, pointweight=2, samplespernode=4)

    def largest_part():
        meshes.meshing_remove_connected_component_by_face_number(mincomponentsize=meshes.current_mesh().face_number() // 2)

    largest_part()
    for offset in (CLOSING, -CLOSING, -OPENING, OPENING):
        meshes.generate_resampled_uniform_mesh(
            cellsize=pymeshlab.PureValue(CELL), offset=pymeshlab.PureValue(offset), multisample=True, mergeclosevert=False
        )
        largest_part()
    meshes.apply_coord_taubin_smoothing(stepsmoothnum=10)
    genus = meshes.get_topological_measures()["genus"]
    if genus != 0:
        sys.exit(f"error: the surface has {genus} tunnels; raise CLOSING or OPENING")
    found = meshes.current_mesh()
    return found.vertex_matrix(), found.face_matrix()


def seam_of(faces):
    """The vertices on the boundary."""
    edges = numpy.sort(numpy.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, counts = numpy.unique(edges, axis=0, return_counts=True)
    return numpy.unique(edges[counts == 1])


def remeshed_half(vertices, faces, edge):
    whole = trimesh.Trimesh(vertices, faces, process=False)
    half = trimesh.intersections.slice_mesh_plane(whole, [1, 0, 0], [0, 0, 0], cap=False)
    half.merge_vertices()
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(half.vertices, half.faces))
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=12, targetlen=pymeshlab.PureValue(edge), featuredeg=60, adaptive=False, checksurfdist=False
    )
    meshes.meshing_remove_connected_component_by_face_number(mincomponentsize=100)
    vertices, faces = meshes.current_mesh().vertex_matrix().copy(), meshes.current_mesh().face_matrix()
    seam = seam_of(faces)
    # A face with all corners on the seam lies in the plane of symmetry, back to back with its mirror image.
    faces = faces[~numpy.isin(faces, seam).all(axis=1)]
    kept, faces = numpy.unique(faces, return_inverse=True)
    vertices, faces = vertices[kept], faces.reshape(-1, 3)
    seam = seam_of(faces)
    if abs(vertices[seam, 0]).max() > 1e-3 or numpy.delete(vertices, seam, 0)[:, 0].min() <= 0:
        sys.exit("error: the cut is not all of the boundary; try another edge length")
    vertices[seam, 0] = 0.0
    corners = vertices[faces]
    if numpy.einsum("ij,ij->", corners[:, 0], numpy.cross(corners[:, 1], corners[:, 2])) < 0:
        faces = faces[:, ::-1]
    return vertices, faces


def write(path, vertices, faces):
    atlas = xatlas.Atlas()
    atlas.add_mesh(vertices.astype("f4"), faces.astype("u4"))
    atlas.generate()
    _, corners, coordinates = atlas[0]
    coordinates = coordinates / coordinates.max() * [0.5, 1.0]
    with open(path, "w") as out:
        out.writelines("v %.6f %.6f %.6f\n" % tuple(vertex) for vertex in vertices)
        out.writelines("vt %.5f %.5f\n" % tuple(pair) for pair in coordinates)
        for face, texture in zip(faces + 1, corners + 1):
            out.write("f " + " ".join(f"{v}/{t}" for v, t in zip(face, texture)) + "\n")


def main():
    if not 3 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    edge = float(sys.argv[3]) if len(sys.argv) == 4 else 0.015
    vertices, faces = remeshed_half(*closed_surface(*points_of(sys.argv[1])), edge)
    write(sys.argv[2], vertices, faces)
    print(f"{sys.argv[2]}: {len(vertices)} vertices, {len(faces)} faces, half of the template")


if __name__ == "__main__":
    main()
