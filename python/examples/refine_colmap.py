"""Refines the cameras of a COLMAP model with the shape prior of what it shows, and writes it back.

  python refine_colmap.py MODEL IMAGES MASKS PRIOR.safetensors OUT

MODEL is a model of undistorted cameras (PINHOLE or SIMPLE_PINHOLE) that pycolmap reads; IMAGES has its pictures by name, MASKS a mask for
each (NAME.png, as COLMAP names them, or the picture's name with .png); white is the object. OUT is made. Cameras keep COLMAP's world
and unit; the points are kept as they are. Needs: pip install pycolmap pillow
"""

import sys
from pathlib import Path

import numpy as np
import pycolmap
from PIL import Image

import spba


def mask_of(folder, name):
    for path in (folder / f"{name}.png", folder / Path(name).with_suffix(".png")):
        if path.exists():
            return np.asarray(Image.open(path).convert("L"))
    raise SystemExit(f"{folder}: no mask for {name}: name it {name}.png")


def pinhole(camera):
    if camera.model.name not in ("PINHOLE", "SIMPLE_PINHOLE"):
        raise SystemExit(f"camera {camera.camera_id} is {camera.model.name}: undistort first (colmap image_undistorter)")
    return [camera.focal_length_x, camera.focal_length_y, camera.principal_point_x, camera.principal_point_y]


def wxyz(rotation):
    x, y, z, w = rotation.quat
    return [w, x, y, z]


def rigid(quaternion_wxyz, translation):
    w, x, y, z = quaternion_wxyz
    return pycolmap.Rigid3d(pycolmap.Rotation3d(np.array([x, y, z, w])), np.array(translation))


def main(model, images, masks, prior, out):
    reconstruction = pycolmap.Reconstruction(model)
    views = sorted(reconstruction.images.values(), key=lambda image: image.name)
    sequence = spba.Sequence()
    for view in views:
        pose = view.cam_from_world()
        picture = np.asarray(Image.open(Path(images) / view.name).convert("RGB"))
        camera = pinhole(reconstruction.cameras[view.camera_id])
        sequence.add(view.name, picture, mask_of(Path(masks), view.name), camera, (wxyz(pose.rotation), list(pose.translation)))
    solution = spba.solve(sequence, spba.Prior.load(prior))
    scale, quaternion, translation = solution.object_from_world
    object_from_world = rigid(quaternion, translation)
    for view, (rotation, shift), iou in zip(views, solution.cam_from_object, solution.silhouette_iou):
        # x_cam = (R_co (s R_ow x + t_ow) + t_co) / s.
        cam_from_world = rigid(rotation, shift) * object_from_world
        cam_from_world.translation = cam_from_world.translation / scale
        view.frame.set_cam_from_world(view.camera_id, cam_from_world)
        print(f"{view.name} silhouette IoU {iou:.3f}")
    Path(out).mkdir(parents=True, exist_ok=True)
    reconstruction.write(out)


if __name__ == "__main__":
    if len(sys.argv) != 6:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
