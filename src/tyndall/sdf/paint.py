"""Which material a place of a shape's surface has: what ``field_surface`` of ``march.wesl`` says, on the CPU.

>>> from tyndall.scene.model import Material
>>> from tyndall.sdf import box, sphere
>>> red = Material(base_color=(1, 0, 0, 1))
>>> materials, which = painted(sphere(1).material(red) | box(1.0).at(2), [[1, 0, 0], [2.5, 0, 0]], Material())
>>> materials[which[0]] is red, materials[which[1]] is red
(True, False)

Of a union's parts the one with the least value gives the material, of an intersection's the one with the greatest.
What is cut by something that has no material of its own shows its own on the cut as well. Where surfaces melt into
each other, the nearer one's material is taken whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Material, Solid
from tyndall.sdf.repetition import Repetition
from tyndall.sdf.shape import Combination, Floats, Modifier, Named, Painted, Shape, Transformed

Numbers = NDArray[np.int64]
_BORROWED = -1  # of a cut: the material of what is cut


def materials_of(shape: Solid) -> list[Material]:
    """All materials that parts of a shape have of their own."""
    return list({id(node.surface): node.surface for node in nodes_of(shape) if isinstance(node, Painted)}.values())


def painted(shape: Shape, points: ArrayLike, default: Material) -> tuple[list[Material], Numbers]:
    """The materials of places on a shape's surface.

    Args:
        points: (N, 3) in the shape's space.
        default: the material of what has none of its own.

    Returns:
        Materials, the default first, and the number (N,) of each place's.

    Raises:
        ParameterError: materials differ below a kind of node that is not known here.
    """
    materials = [default, *materials_of(shape)]
    brush = _Brush({id(material): i for i, material in reversed(list(enumerate(materials)))})
    _, which = brush.stroke(shape, np.asarray(points, np.float64), 0)
    return materials, np.maximum(which, 0)


@dataclass
class _Brush:
    numbers: dict[int, int]

    def stroke(self, shape: Shape, p: Floats, inherited: int) -> tuple[Floats, Numbers]:
        """Values at places, and whose material they have."""
        while isinstance(shape, Painted):
            inherited = self.numbers[id(shape.surface)]
            shape = shape.shape
        if not any(isinstance(node, Painted) for node in nodes_of(shape)):
            return shape.distance(p), np.full(len(p), inherited)
        match shape:
            case Combination():
                return shape.distance(p), self._joined(shape, p, inherited)
            case Modifier():
                value, which = self.stroke(shape.shape, shape.enter(p), inherited)
                return shape.leave(value, p), which
            case Transformed():
                inverse = np.linalg.inv(shape.placement)
                value, which = self.stroke(shape.shape, p @ inverse[:3, :3].T + inverse[:3, 3], inherited)
                return shape.factor * value, which
            case Repetition():
                return self.stroke(Combination(shape.copies()), p, inherited)
            case Named():
                return self.stroke(shape.shape, p, inherited)
            case _:
                raise ParameterError(f"shape: the materials in a {type(shape).__name__} are not known here")

    def _joined(self, shape: Combination, p: Floats, inherited: int) -> Numbers:
        cutting = shape.operation == "subtraction"
        best: Floats | None = None
        which = np.full(len(p), inherited)
        for i, child in enumerate(shape.shapes):
            value, mine = self.stroke(child, p, _BORROWED if cutting and i else inherited)
            if shape.operation == "union" or (cutting and i):
                value = -value
            if best is None:
                best, which = value, mine
                continue
            ahead = value > best
            which = np.where(ahead & (mine != _BORROWED), mine, which) if cutting else np.where(ahead, mine, which)
            best = np.maximum(best, value)
        return which


def nodes_of(shape: Solid) -> Iterator[Solid]:
    waiting = [shape]
    while waiting:
        node = waiting.pop()
        yield node
        waiting += reversed(getattr(node, "children", ()))
