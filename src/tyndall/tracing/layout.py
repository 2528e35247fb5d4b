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

from tyndall.content.mesh import normal_rows
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
        leaves: triangles in all groups.
        groups: how many groups hold triangles.
    """

    parts: NDArray[Any]
    instances: NDArray[Any]
    hanging: NDArray[np.uint32]
    boxes: NDArray[Any]
    box: NDArray[Any]
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
    uses = Counter(id(instance.mesh) for instance in scene.instances)
    groups: dict[int, int] = {}
    of_instance = []
    for instance in scene.instances:
        key = id(instance.mesh)
        shared = (movable or uses[key] > 1) and not is_flat(np.asarray(instance.transform))
        own = key in groups or len(groups) < MAX_GROUPS - 1
        of_instance.append(groups.setdefault(key, 1 + len(groups)) if shared and own else 0)

    count = len(scene.instances)
    instances = np.zeros(count + 1, dtypes["Placed"])
    lower, upper = np.full((1 + len(groups), 3), np.inf), np.full((1 + len(groups), 3), -np.inf)
    parts: dict[tuple[int, int], tuple[Any, ...]] = {}
    for i, (instance, group) in enumerate(zip(scene.instances, of_instance, strict=True)):
        place(instances[i], np.asarray(instance.transform), group)
        mesh = instance.mesh
        to_group = np.eye(4) if group else np.asarray(instance.transform)
        part = (group, 0 if group else i)
        if part in parts:
            continue
        flags = MASKED * (mesh.material.alpha_mode == "mask") | DOUBLE_SIDED * mesh.material.double_sided
        flags |= PLACED if group else i | FLIPPED * bool(np.linalg.det(to_group[:3, :3]) < 0)
        first = placed[id(mesh)][0] // 3
        parts[part] = (to_group[:3], 0, first, number[id(mesh)], flags, group, mesh.triangle_count)
        low, high = (corner.astype(np.float64) for corner in mesh.bounds)
        corners = box_corners(low, high) @ to_group[:3, :3].T + to_group[:3, 3]
        lower[group] = np.minimum(lower[group], corners.min(axis=0))
        upper[group] = np.maximum(upper[group], corners.max(axis=0))

    place(instances[count], np.eye(4), 0)
    instances[count]["in_world"] = 1
    ordered = [parts[key] for key in sorted(parts)]
    rows = np.zeros(max(1, len(ordered)), dtypes["Part"])
    leaves = 0
    for row, (to_group, _, first, mesh_number, flags, group, triangles) in zip(rows, ordered, strict=False):
        row["to_group"], row["first"], row["first_triangle"] = to_group, leaves, first
        row["mesh"], row["flags"], row["group"] = mesh_number, flags, group
        leaves += triangles
    boxes, box = np.zeros(len(lower), dtypes["Box"]), np.zeros(1, dtypes["Box"])
    boxes["lower"], boxes["upper"] = np.where(lower <= upper, lower, 0), np.where(lower <= upper, upper, 0)
    box["lower"][0], box["upper"][0] = scene.bounds
    hanging = [i for i, group in enumerate(of_instance) if group]
    in_world = any(group == 0 for group, _ in parts)
    return Layout(
        parts=rows,
        instances=instances,
        hanging=np.array(hanging + [count] * in_world, np.uint32),
        boxes=boxes,
        box=box,
        leaves=leaves,
        groups=len(groups) + in_world,
    )


def place(row: Any, matrix: NDArray[np.float64], group: int) -> None:
    """Fill in a ``rays::Placed`` for a 4×4 transform; of a flat one the way back is left at zero."""
    row["to_world"], row["group"] = matrix[:3], group
    row["normal"][:, :3] = normal_rows(matrix[:3, :3])
    if not is_flat(matrix):
        row["to_local"] = np.linalg.inv(matrix)[:3]


def is_flat(matrix: NDArray[np.float64]) -> bool:
    """Whether a 4×4 transform has no inverse, so that no ray can be brought into its mesh's space."""
    linear = matrix[:3, :3]
    volume = float(np.prod(np.linalg.norm(linear, axis=0)))
    return not abs(float(np.linalg.det(linear))) > _FLATTEST * volume
