"""Whether the cells of implicit objects say the same as their whole programs, at random points.

Where a cell has a program, its value must be that of the whole but for rounding. What a ray is told, a value or a
bound, is of the same sign as the whole's value, and no larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.gpu.device import Gpu
from tyndall.scene.model import Implicit
from tyndall.sdf.field import Field

_MODULE = "package::lab::field_check"
_AT_ONCE = 1 << 20  # points
_ROUNDING = 1e-5  # m


@dataclass(frozen=True)
class Agreement:
    """What was found.

    Attributes:
        points: how many were asked.
        near: how many of them are in cells with a program.
        difference: the largest |cell's − whole's| among those, in metres.
        excess: the largest by which what a ray is told is beyond the whole's value, in metres; 0: never.
        flipped: points where what a ray is told has the other sign, and is more than rounding.
    """

    points: int
    near: int
    difference: float
    excess: float
    flipped: int

    def to_json(self) -> dict[str, float]:
        """Plain data."""
        return {name: getattr(self, name) for name in ("points", "near", "difference", "excess", "flipped")}


def values(gpu: Gpu, field: Field, index: int, points: ArrayLike) -> NDArray[np.float32]:
    """(N, 4): value of the whole program, of the cell's program, 1 where it has one or 0, and what a ray is told.

    Args:
        index: of the object.
        points: (N, 3) in the object's own space.
    """
    found = [np.zeros((0, 4), np.float32)]
    places = np.asarray(points, np.float32)
    field.update()
    for start in range(0, len(places), _AT_ONCE):
        rows = np.zeros((min(_AT_ONCE, len(places) - start), 4), np.float32)
        rows[:, :3] = places[start : start + _AT_ONCE]
        with (
            gpu.buffer("check.points", rows, owner="check", element="vec4f") as given,
            gpu.buffer("check.values", rows.nbytes, owner="check", element="vec4f") as out,
        ):
            gpu.compute("check", _MODULE, "check").bind(
                field.bindings,
                check_count=gpu.constant(len(rows)),
                check_object=gpu.constant(index),
                check_points=given.read(),
                check_values=out.read_write(),
            ).dispatch_line(len(rows))
            found.append(gpu.read_buffer(out).view(np.float32).reshape(-1, 4).copy())
        gpu.forget_groups()
    return np.concatenate(found)


def agreement(
    gpu: Gpu, field: Field, implicits: Sequence[Implicit], points: int = 1_000_000, *, seed: int = 0
) -> Agreement:
    """Ask all objects at random points: half of them anywhere in their boxes, half near where a surface may be.

    Args:
        implicits: the objects that the field was made from.
        points: how many, of all objects together.
    """
    rng = np.random.default_rng(seed)
    parts = []
    share = -(-points // max(1, len(implicits)))
    for index, implicit in enumerate(implicits):
        low, high = (np.clip(corner, -10, 10) for corner in implicit.shape.box)
        anywhere = rng.uniform(low, high, (max(1, share // 2), 3))
        # Those nearest to the surface of twice as many, and small steps from them.
        asked = rng.uniform(low, high, (share, 3))
        order = np.argsort(np.abs(values(gpu, field, index, asked)[:, 0]))[: max(1, share // 16)]
        near = asked[rng.choice(order, share - len(anywhere))]
        near = np.clip(near + rng.normal(0, 0.005, near.shape) * (high - low), low, high)
        parts.append(values(gpu, field, index, np.concatenate([anywhere, near])))
    every = np.concatenate(parts)[:points]
    whole, pruned, told = (every[:, i].astype(float) for i in (0, 1, 3))
    has = every[:, 2] > 0
    other_side = (np.sign(told) * np.sign(whole) < 0) & (np.abs(told - whole) > _ROUNDING)
    return Agreement(
        len(every),
        int(has.sum()),
        float(np.abs(pruned - whole)[has].max(initial=0.0)),
        float((np.abs(told) - np.abs(whole)).max(initial=0.0)),
        int(other_side.sum()),
    )
