"""A union of many leaves as a list that a shader loops over: what people write where there are too many for code.

Code with a number for each leaf (:mod:`tyndall.sdf.literal`) cannot move them, and from some hundred on takes seconds
to compile. The plain way is then an array, and a loop over all of it at each step of each ray:

- leaves that only have a place, are of one kind with one number and of one material take a ``vec4f`` each, as spheres
  do;
- leaves that only have a place take three or four: place and kind, and the numbers;
- others take six: the inverse of their transform too.

A smooth union is taken from the first leaf to the last, and not by pairs as in
:class:`~tyndall.sdf.shape.Combination`: a loop that keeps partial results by pairs is slower. Where three and more
surfaces meet within the width of the blend the two differ, by at most that width.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Material, translations
from tyndall.sdf.shape import Blend, Combination, Floats, Named, Painted, Primitive, Shape, Transformed

FEWEST = 65  # leaves of a union that is listed where nobody says otherwise; fewer are better as code


@dataclass(frozen=True)
class Leaf:
    """A primitive of a list: ``outer · move · inner`` is its placement, and ``move`` what its name is moved by."""

    primitive: Primitive
    outer: Floats
    inner: Floats
    name: str | None
    factor: float
    material: Material


@dataclass(frozen=True)
class List:
    """A union's leaves.

    Attributes:
        leaves: in order.
        smooth, blend: as :class:`~tyndall.sdf.shape.Combination` has them.
    """

    leaves: tuple[Leaf, ...]
    smooth: float
    blend: Blend

    @classmethod
    def of(cls, shape: Shape, material: Material, matrix: Floats | None = None) -> List | None:
        """The list of a shape under a transform; None where it is no union of leaves alone, in one way."""
        top: Shape = shape
        while isinstance(top, (Transformed, Painted, Named)):
            top = top.shape
        if not isinstance(top, Combination) or top.operation != "union":
            return None
        base = np.eye(4) if matrix is None else matrix
        start = Leaf(_NOTHING, base, np.eye(4), None, _least(base), material)
        try:
            leaves = tuple(_walk(shape, start, (top.smooth, top.blend)))
        except _OtherKindError:
            return None
        return cls(leaves, top.smooth, top.blend)

    @cached_property
    def kinds(self) -> list[Primitive]:
        """A leaf of each kind, in the order of their numbers."""
        found: dict[type[Primitive], Primitive] = {}
        for leaf in self.leaves:
            found.setdefault(type(leaf.primitive), leaf.primitive)
        return list(found.values())

    @cached_property
    def materials(self) -> list[Material]:
        """Each material once, in the order of their numbers."""
        return list(dict.fromkeys(leaf.material for leaf in self.leaves))

    @cached_property
    def layout(self) -> str:
        """ "bare", "placed" or "turned"; see the module."""
        matrices = self._matrices({})
        plain = np.allclose(matrices[:, :3, :3], np.eye(3), atol=1e-12) and all(
            abs(leaf.factor - 1) < 1e-9 for leaf in self.leaves
        )
        if not plain:
            return "turned"
        few = max(len(leaf.primitive.numbers) for leaf in self.leaves) <= 1
        return "bare" if few and len(self.kinds) == len(self.materials) == 1 else "placed"

    @property
    def stride(self) -> int:
        """Rows of a leaf."""
        return {"bare": 1, "placed": 2 + self.is_long, "turned": 6}[self.layout]

    @cached_property
    def is_long(self) -> bool:
        """Whether a leaf has more than four numbers."""
        return max(len(leaf.primitive.numbers) for leaf in self.leaves) > 4

    def rows(self, moves: Mapping[str, ArrayLike] | None = None) -> NDArray[np.float32]:
        """(count · stride, 4) float32, as the loop reads them.

        Args:
            moves: what names are moved by: (4, 4), or (N, 4, 4) or (N, 3) for N leaves of a name in order.

        Raises:
            ParameterError: another shape of array, or a turn where the list's layout has only places.
        """
        matrices = self._matrices(moves or {})
        layout = self.layout
        if layout != "turned" and moves and not np.allclose(matrices[:, :3, :3], np.eye(3), atol=1e-6):
            raise ParameterError("moves: this list's leaves have places and no directions")
        rows = self._still.copy()
        if layout == "turned":
            rows[:, :3] = np.linalg.inv(matrices)[:, :3]
        else:
            rows[:, 0, :3] = matrices[:, :3, 3]
        return rows.reshape(-1, 4)

    @cached_property
    def _still(self) -> NDArray[np.float32]:
        """(count, stride, 4): the rows without their places."""
        rows = np.zeros((len(self.leaves), self.stride, 4), np.float32)
        numbers = np.zeros((len(self.leaves), 8), np.float32)
        for row, leaf in zip(numbers, self.leaves, strict=True):
            row[: len(leaf.primitive.numbers)] = leaf.primitive.numbers
        if self.layout == "bare":
            rows[:, 0, 3] = numbers[:, 0]
            return rows
        codes, materials = [type(kind) for kind in self.kinds], self.materials
        bits = [codes.index(type(leaf.primitive)) | materials.index(leaf.material) << 8 for leaf in self.leaves]
        tags = np.array(bits, np.uint32).view(np.float32)
        if self.layout == "placed":
            rows[:, 0, 3], rows[:, 1] = tags, numbers[:, :4]
            if self.is_long:
                rows[:, 2] = numbers[:, 4:]
        else:
            rows[:, 3, 0], rows[:, 3, 1] = tags, [leaf.factor for leaf in self.leaves]
            rows[:, 4], rows[:, 5] = numbers[:, :4], numbers[:, 4:]
        return rows

    @cached_property
    def _placed(self) -> tuple[Floats, Floats]:
        """(N, 4, 4) transforms outside and inside of the names."""
        return np.array([leaf.outer for leaf in self.leaves]), np.array([leaf.inner for leaf in self.leaves])

    @cached_property
    def _named(self) -> dict[str, NDArray[np.intp]]:
        """Numbers of the leaves of each name."""
        found: dict[str, list[int]] = {}
        for i, leaf in enumerate(self.leaves):
            if leaf.name is not None:
                found.setdefault(leaf.name, []).append(i)
        return {name: np.array(at) for name, at in found.items()}

    def _matrices(self, moves: Mapping[str, ArrayLike]) -> Floats:
        """(N, 4, 4) placements."""
        outer, inner = self._placed
        for name, given in moves.items():
            if (at := self._named.get(name)) is not None:
                inner = inner.copy()
                inner[at] = as_matrices(given, len(at)) @ inner[at]
        placed: Floats = outer @ inner
        return placed


def as_matrices(given: ArrayLike, count: int) -> Floats:
    """(N, 4, 4) from (4, 4), (N, 4, 4) or offsets (N, 3).

    Raises:
        ParameterError: another shape.
    """
    value = np.asarray(given, np.float64)
    if value.shape in ((4, 4), (count, 4, 4)):
        return np.broadcast_to(value, (count, 4, 4))
    if value.shape not in ((count, 3), (3,)):
        raise ParameterError(f"moves: shape {value.shape} is not (4, 4), ({count}, 4, 4) or ({count}, 3)")
    return translations(np.broadcast_to(value, (count, 3)))


class _OtherKindError(Exception):
    """A node that a list has no place for."""


def _walk(node: Shape, so_far: Leaf, how: tuple[float, Blend]) -> Iterator[Leaf]:
    match node:
        case Primitive():
            yield replace(so_far, primitive=node)
        case Combination(operation="union") if (node.smooth, node.blend) == how:
            for child in node.shapes:
                yield from _walk(child, so_far, how)
        case Transformed():
            place = "outer" if so_far.name is None else "inner"
            matrix = getattr(so_far, place) @ node.placement
            changes: dict[str, Any] = {place: matrix, "factor": so_far.factor * node.factor}
            yield from _walk(node.shape, replace(so_far, **changes), how)
        case Painted():
            yield from _walk(node.shape, replace(so_far, material=node.surface), how)
        case Named() if so_far.name is None:
            yield from _walk(node.shape, replace(so_far, name=node.name), how)
        case _:
            raise _OtherKindError


def _least(matrix: Floats) -> float:
    return float(np.linalg.svd(matrix[:3, :3], compute_uv=False)[-1])


_NOTHING = Primitive()
