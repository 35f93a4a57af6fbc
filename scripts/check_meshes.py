"""Checks the meshes of results: manifold, closed, no degenerate face, how many faces cut others, and what gltf-validator says.

Usage: check_meshes.py RESULT... Prints a line each; ends with status 1 where a mesh is no closed manifold, has a degenerate face,
more than 0.5 % of faces that cut others, or an issue of the validator. Needs: pip install pymeshlab trimesh, and where gltf-validator
is to be asked, npm install gltf-validator in the working directory.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pymeshlab
import trimesh

MOST_CUTTING = 0.005
# Of the square of the mean edge.
LEAST_AREA = 1e-6
VALIDATE = """
const validator = require("gltf-validator");
const bytes = new Uint8Array(require("fs").readFileSync(process.argv[1]));
validator.validateBytes(bytes).then(({ issues }) => console.log(JSON.stringify(issues)));
"""


def degenerate(mesh):
    """How many faces have next to no area."""
    unit = np.mean(mesh.edges_unique_length) ** 2
    return int(np.sum(mesh.area_faces < LEAST_AREA * unit))


def validator_issues(path):
    """Errors, warnings and remarks of gltf-validator; None where it is not installed."""
    if not Path("node_modules/gltf-validator").exists():
        return None
    told = subprocess.run(["node", "-e", VALIDATE, path], check=True, capture_output=True, text=True).stdout
    issues = json.loads(told)
    return [issues[f"num{kind}"] for kind in ("Errors", "Warnings", "Infos")]


def check(result):
    """Prints what is found in a result's folder; whether all is well."""
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(result / "mesh.ply"))
    faces = meshes.current_mesh().face_number()
    topology = meshes.get_topological_measures()
    meshes.compute_selection_by_self_intersections_per_face()
    cutting = meshes.current_mesh().selected_face_number() / faces
    counts = {
        "non-manifold": topology["non_two_manifold_edges"] + topology["non_two_manifold_vertices"],
        "open edges": topology["boundary_edges"],
        "degenerate": degenerate(trimesh.load(result / "mesh.ply", process=False)),
    }
    issues = validator_issues(result / "mesh.glb")
    told = "not asked" if issues is None else "/".join(map(str, issues))
    words = ", ".join(f"{what} {count}" for what, count in counts.items())
    print(f"{result}: {faces} faces, {words}, cutting others {100 * cutting:.3f} %, gltf-validator {told}")
    return not any(counts.values()) and cutting <= MOST_CUTTING and not any(issues or [])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="+", type=Path, metavar="RESULT")
    sound = [check(result) for result in parser.parse_args().results]
    sys.exit(0 if all(sound) else 1)


if __name__ == "__main__":
    main()
