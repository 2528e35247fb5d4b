"""How a scene's triangles are divided into groups, each with a tree of its own.

What is placed once, or flattened by its transform, is in *world space*: one group for all of it, group 0. A mesh that
is placed several times is a group in its own space, and its instances hang in the upper tree.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.content.mesh import from_origin, normal_columns, origin_of
from tyndall.scene.model import Scene, box_corners

MAX_GROUPS = 1 << 16  # the group is the upper half of a key's second word

# As tracing/rays.wesl has them.
MASKED, DOUBLE_SIDED, FLIPPED, PLACED = 1 << 31, 1 << 30, 1 << 29, (1 << 29) - 1

_FLATTEST = 1e-12  # of the matrix's determinant over the product of its columns' lengths


@dataclass(frozen=True, eq=False)
class Layout:
    """What the build starts from; rows as the WESL structs of these names.

    Attributes:
        parts: ``build::Part`` in the order of their first leaf.
        instances: ``rays::Placed``, one for each instance of the scene, and world space as the last.
        hanging: rows of ``instances`` that are leaves of the upper tree.
        boxes: ``build::Box`` of each group, in its own space.
        box: world's box of everything.
        origins: (N, 3) where each instance's mesh has the origin of its vertices on the device.
        leaves: triangles in all groups.
        groups: how many groups hold triangles.
    """

    parts: NDArray[Any]
    instances: NDArray[Any]
    hanging: NDArray[np.uint32]
    boxes: NDArray[Any]
    box: NDArray[Any]
    origins: NDArray[np.float64]
    leaves: int
    groups: int

    @property
    def instanced(self) -> bool:
        """Whether a ray may have to enter another space than the world's."""
        return bool((self.hanging < len(self.instances) - 1).any())


def arrange(
    scene: Scene,
    placed: Mapping[int, tuple[int, int]],
    dtypes: Mapping[str, np.dtype[Any]],
    *,
    movable: bool = False,
) -> Layout:
    """Divide a scene's instances.

    Args:
        placed: by a mesh's ``id``, its first index and first vertex in the buffers, in the order of the mesh table.
        dtypes: layouts of "Part", "Placed" and "Box".
        movable: give every mesh a group of its own.
    """
    number = {key: i for i, key in enumerate(placed)}
    count = len(scene.instances)
    origins = np.array([origin_of(i.mesh) for i in scene.instances], np.float64).reshape(count, 3)
    matrices = from_origin(np.array([i.transform for i in scene.instances], np.float64).reshape(count, 4, 4), origins)
    flat = is_flat(matrices)
    uses = Counter(id(instance.mesh) for instance in scene.instances)
    groups: dict[int, int] = {}
    of_instance = np.zeros(count + 1, np.int64)
    for i, instance in enumerate(scene.instances):
        key = id(instance.mesh)
        if (movable or uses[key] > 1) and not flat[i] and (key in groups or len(groups) < MAX_GROUPS - 1):
            of_instance[i] = groups.setdefault(key, 1 + len(groups))

    parts: dict[tuple[int, int], tuple[Any, ...]] = {}
    lower, upper = np.full((1 + len(groups), 3), np.inf), np.full((1 + len(groups), 3), -np.inf)
    turned = np.linalg.det(matrices[:, :3, :3]) < 0
    for i, instance in enumerate(scene.instances):
        group, mesh = int(of_instance[i]), instance.mesh
        part = (group, 0 if group else i)
        if part in parts:
            continue
        low, high = (corner - origins[i] for corner in mesh.bounds)
        to_group = np.eye(4) if group else matrices[i]
        flags = MASKED * (mesh.material.alpha_mode == "mask") | DOUBLE_SIDED * mesh.material.double_sided
        flags |= PLACED if group else i | FLIPPED * int(turned[i])
        parts[part] = (to_group[:3], placed[id(mesh)][0] // 3, number[id(mesh)], flags, group, mesh.triangle_count)
        corners = box_corners(low, high) @ to_group[:3, :3].T + to_group[:3, 3]
        lower[group] = np.minimum(lower[group], corners.min(axis=0))
        upper[group] = np.maximum(upper[group], corners.max(axis=0))

    instances = np.zeros(count + 1, dtypes["Placed"])
    instances["group"] = of_instance
    instances["in_world"][count] = 1
    place(instances, np.concatenate([matrices, np.eye(4)[None]]))
    ordered = [parts[key] for key in sorted(parts)]
    rows = np.zeros(max(1, len(ordered)), dtypes["Part"])
    leaves = 0
    for row, (to_group, first, mesh_number, flags, group, triangles) in zip(rows, ordered, strict=False):
        row["to_group"], row["first"], row["first_triangle"] = to_group, leaves, first
        row["mesh"], row["flags"], row["group"] = mesh_number, flags, group
        leaves += triangles
    boxes, box = np.zeros(len(lower), dtypes["Box"]), np.zeros(1, dtypes["Box"])
    boxes["lower"], boxes["upper"] = np.where(lower <= upper, lower, 0), np.where(lower <= upper, upper, 0)
    box["lower"][0], box["upper"][0] = scene.bounds
    in_world = any(group == 0 for group, _ in parts)
    hanging = np.flatnonzero(of_instance[:count]).tolist() + [count] * in_world
    return Layout(
        parts=rows,
        instances=instances,
        hanging=np.array(hanging, np.uint32),
        boxes=boxes,
        box=box,
        origins=origins,
        leaves=leaves,
        groups=len(groups) + in_world,
    )


def place(rows: NDArray[Any], matrices: NDArray[np.float64]) -> None:
    """Fill in ``rays::Placed`` rows, (N,), for transforms (N, 4, 4) of vertices as they are on the device. Of a flat
    one the way back stays zero.
    """
    rows["to_world"] = matrices[:, :3]
    rows["normal"][..., :3] = normal_columns(matrices[:, :3, :3]).transpose(0, 2, 1)
    back = ~is_flat(matrices)
    to_local = np.zeros_like(rows["to_local"])
    to_local[back] = np.linalg.inv(matrices[back])[:, :3]
    rows["to_local"] = to_local


def is_flat(matrices: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(N,) whether transforms (N, 4, 4) have no inverse, so that no ray can be brought into their meshes' space."""
    linear = matrices[:, :3, :3]
    volume = np.prod(np.linalg.norm(linear, axis=1), axis=1)
    flat: NDArray[np.bool_] = ~(np.abs(np.linalg.det(linear)) > _FLATTEST * volume)
    return flat
