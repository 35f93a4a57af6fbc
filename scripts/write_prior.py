#!/usr/bin/env python3
"""Writes a shape prior for spba-ceres with NumPy and safetensors: boxes of three sizes, as an example.

scripts/write_prior.py boxes.safetensors && spba-ceres prior show boxes.safetensors --out boxes.png
"""
import json
import sys

import numpy as np
from safetensors.numpy import save_file

N, S = 2400, 3
random = np.random.default_rng(0)

# N points on the unit cube's faces in any order whose prefixes cover it evenly, and their outward unit normals.
points = random.uniform(-0.5, 0.5, (N, 3))
face = np.arange(N) % 6
points[np.arange(N), face % 3] = np.where(face < 3, 0.5, -0.5)
normals = np.where(np.arange(3) == (face % 3)[:, None], 2 * points, 0)

# X(s) = mean + sum_k s_k basis_k, s ~ N(0, I); +y up, -z front, the box centred with diagonal 1.
size = np.array([0.4, 0.35, 0.84])
size /= np.linalg.norm(size)
mean = points * size
basis = np.stack([0.1 * size[k] * points * (np.arange(3) == k) for k in range(S)])

info = {
    "schema": 1, "kind": "linear", "category": "box", "symmetry": "none", "styles": S, "points": N,
    "frame": "+Y up, -Z front, the body's box centred at the origin with diagonal 1 (beyond each of its faces "
             "lies 1 % of the surface: antennas, mirrors)",
    "command": "scripts/write_prior.py", "seed": 0, "explained_variance": [],
    "licences": ["CC0-1.0"], "sources": [{"model": "box", "package": "none", "licence": "CC0-1.0"}],
}
tensors = {"mean": mean.astype("f4"), "basis": basis.astype("f2"), "normals": normals.astype("f2")}
save_file(tensors, sys.argv[1], {"spba_prior": json.dumps(info)})
