"""The box of a shape whose named parts move, without a new analysis of all of it each time.

What moves together is one box in a space of its own, found once by :meth:`~tyndall.sdf.shape.Shape.extent`; a motion
turns these few boxes, not the shape.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tyndall.sdf.repetition import Repetition
from tyndall.sdf.shape import Box, Combination, Floats, Named, Painted, Shape, Transformed, transformed_box

_STILL = np.eye(4)
LEAST = 0.5  # of a motion's stretches, for which the boxes are
_Chain = tuple[tuple[bytes, str, int], ...]  # static transforms, each before a named part's motion


@dataclass(frozen=True, eq=False)
class Hull:
    """Boxes of what moves together.

    Attributes:
        groups: for each, the way to its space, (static transform, name, number of the part) a step, and its box there.
    """

    groups: tuple[tuple[tuple[tuple[Floats, str, int], ...], Box], ...]

    @classmethod
    def of(cls, shape: Shape) -> Hull | None:
        """The boxes of a shape; None where a name is inside of what is no union, transform or copy."""
        boxes: dict[_Chain, list[Box]] = defaultdict(list)
        if not _gather(shape, np.eye(4), (), 0.0, defaultdict(int), boxes):
            return None
        groups = []
        for chain, found in boxes.items():
            lows, highs = np.array([low for low, _ in found]), np.array([high for _, high in found])
            steps = tuple((np.frombuffer(static).reshape(4, 4), name, number) for static, name, number in chain)
            groups.append((steps, (lows.min(axis=0), highs.max(axis=0))))
        return cls(tuple(groups))

    def box(self, moves: Mapping[str, Floats]) -> Box | None:
        """The box where the parts are moved by (N, 4, 4) transforms a name; None where one of them makes its part much
        smaller, as what smooth unions add would be more of it.
        """
        if moves:
            linear = np.concatenate([matrices[:, :3, :3] for matrices in moves.values()])
            if np.linalg.svd(linear, compute_uv=False).min() < LEAST:
                return None
        placed = np.empty((len(self.groups), 4, 4))
        for row, (steps, _) in zip(placed, self.groups, strict=True):
            matrix = _STILL
            for static, name, number in steps:
                matrix = matrix @ static if matrix is not _STILL else static
                if name in moves:
                    matrix = matrix @ moves[name][number]
            row[:] = matrix
        low, high = transformed_box((self._lows, self._highs), placed)
        return low.min(axis=0), high.max(axis=0)

    @cached_property
    def _lows(self) -> Floats:
        return np.array([low for _, (low, _) in self.groups])[:, None]

    @cached_property
    def _highs(self) -> Floats:
        return np.array([high for _, (_, high) in self.groups])[:, None]


def _has_names(shape: Shape) -> bool:
    return isinstance(shape, Named) or any(_has_names(child) for child in shape.children)


def _gather(
    shape: Shape,
    matrix: Floats,
    chain: _Chain,
    level: float,
    order: dict[str, int],
    boxes: dict[_Chain, list[Box]],
) -> bool:
    """Add the boxes of all places where the value is at most ``level``."""
    if not _has_names(shape):
        boxes[chain].append(transformed_box(shape.extent(level), matrix))
        return True
    match shape:
        case Painted():
            return _gather(shape.shape, matrix, chain, level, order, boxes)
        case Transformed():
            placed = matrix @ shape.placement
            return _gather(shape.shape, placed, chain, level / shape.factor, order, boxes)
        case Named():
            step = (np.ascontiguousarray(matrix).tobytes(), shape.name, order[shape.name])
            order[shape.name] += 1
            return _gather(shape.shape, np.eye(4), (*chain, step), level / LEAST, order, boxes)
        case Combination(operation="union"):
            more = level + shape.swell * math.ceil(math.log2(len(shape.shapes)))
            return all(_gather(child, matrix, chain, more, order, boxes) for child in shape.shapes)
        case Combination(operation="subtraction"):  # what is taken away has no part in the box
            kept = _gather(shape.shapes[0], matrix, chain, level, order, boxes)
            unused: dict[_Chain, list[Box]] = defaultdict(list)
            return kept and all(_gather(child, matrix, (), level, order, unused) for child in shape.shapes[1:])
        case Repetition(opaque=False):
            begin = dict(order)
            for copy in shape.copies():
                order.clear()
                order.update(begin)
                if not _gather(copy, matrix, chain, level, order, boxes):
                    return False
            return True
        case _:
            return False
