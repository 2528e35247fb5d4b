"""A scene whose implicit surfaces are triangles, for judges that know nothing else.

Each surface is meshed once by marching cubes (:mod:`tyndall.sdf.meshing`), with the field's normals at its vertices,
and divided by its materials (:mod:`tyndall.sdf.paint`), a triangle going to that of its middle. So what comes out is
the surface to a fraction of a cell, with edges bevelled by about half a cell and borders of materials ragged by one;
where materials melt into each other, one ends. What only an implicit surface can be, mirror, glass or painted by a
user's function, is refused.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Implicit, Instance, Mesh, Scene, box_corners
from tyndall.sdf.meshing import to_mesh
from tyndall.sdf.paint import painted
from tyndall.sdf.shading import ShadedMaterial
from tyndall.sdf.shape import Shape

RESOLUTION = 128
_BEYOND = 4.0  # of the scene's diagonal: where what has no end is cut off


def meshed(scene: Scene, resolution: int = RESOLUTION) -> Scene:
    """The same scene with meshes in place of its implicit surfaces; itself where it has none.

    Args:
        resolution: cells along the longest side of each surface's box. What has no end is cut off four of the scene's
            diagonals, camera and lights included, beyond it.

    Raises:
        ParameterError: a surface that cannot be meshed, or scikit-image is missing.
    """
    if not scene.implicits:
        return scene
    made = [part for implicit in scene.implicits for part in _parts(implicit, scene, resolution)]
    return scene.with_(instances=(*scene.instances, *made), implicits=())


def _parts(implicit: Implicit, scene: Scene, resolution: int) -> list[Instance]:
    """One instance for each of its materials."""
    shape = implicit.shape
    if not isinstance(shape, Shape):
        raise ParameterError(f"shape: a {type(shape).__name__} cannot be meshed")
    bounds = None if implicit.bounds is not None else _cut(shape, implicit, scene)
    whole = to_mesh(shape, resolution, bounds=bounds, material=implicit.material)
    corners = whole.positions[whole.indices].astype(np.float64)
    materials, which = painted(shape, corners.mean(axis=1), implicit.material)
    for material in materials:
        if isinstance(material, ShadedMaterial) or material.reflections or material.transmission > 0:
            raise ParameterError(f"material: '{material.name}' has what triangles cannot have; see tyndall.lab.meshed")
    parts = []
    for number, material in enumerate(materials):
        triangles = whole.indices[which == number]
        if len(triangles):
            used, local = np.unique(triangles, return_inverse=True)
            indices = local.reshape(-1, 3).astype(np.uint32)
            mesh = Mesh(whole.positions[used], indices, normals=_taken(whole.normals, used), material=material)
            parts.append(Instance(mesh, implicit.transform))
    return parts


def _taken(normals: NDArray[np.float32] | None, used: NDArray[np.int64]) -> NDArray[np.float32] | None:
    return None if normals is None else normals[used]


def _cut(shape: Shape, implicit: Implicit, scene: Scene) -> tuple[list[float], list[float]]:
    """Its box, with ends in its own space where it has none."""
    places = [*scene.bounds, np.asarray(scene.camera.position)]
    places += [np.asarray(position) for light in scene.lights if (position := getattr(light, "position", None))]
    low, high = np.min(places, axis=0), np.max(places, axis=0)
    reach = _BEYOND * float(np.linalg.norm(high - low))
    back = np.linalg.inv(np.asarray(implicit.transform))
    corners = box_corners(low - reach, high + reach) @ back[:3, :3].T + back[:3, 3]
    lower = np.maximum(shape.box[0], corners.min(axis=0))
    upper = np.minimum(shape.box[1], corners.max(axis=0))
    return lower.tolist(), upper.tolist()
