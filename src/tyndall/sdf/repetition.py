"""One shape, many times.

- :class:`Repeated` and :class:`Polar` are unions of placed copies, which :meth:`Repetition.copies` lists; the program
  holds each of them, so that each cell of space keeps only those that are near it.
- :class:`RepeatedForever` has copies without end. A value is the least over the copy of the place's own cell and of its
  neighbours towards the place, on each axis.
- :class:`MirroredForever` turns every second copy into a mirror image, which makes one fold of the place enough.

What a usual repetition gets wrong is the neighbours: the value jumps at the wall of a cell wherever the copy beyond is
the nearer one, and rays step through it. Here no value is above that of a copy that was left out. Where the child's
values are distances and it fits its cell, none of those is ever nearer. Otherwise the copies that are left out are one
spacing or more away on some axis, in their own space, and their values there are above every level whose extent is
within one spacing. The greatest such level caps the value: what is capped is the same as if all copies had been asked,
so it has the child's bound. The price is that no step is longer than the cap.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from tyndall.gpu.params import ParameterError, check, param
from tyndall.sdf.modifiers import at_a_wall, weakest
from tyndall.sdf.shape import Accuracy, Box, Floats, Modifier, Shape, Vec3, of_shape, rotation

MOST_COPIES = 4096
UNCAPPED = 1e30
LEAST_CAP = 1e-3  # of the spacing, below which a ray would take every place for a surface


class Repetition(Shape):
    """One child many times: the union of :meth:`copies`.

    Attributes:
        opaque: whether the bound holds only for all copies together, so that none may be left out alone.
    """

    opaque: ClassVar[bool] = False
    shape: Shape

    def copies(self) -> tuple[Shape, ...]:
        """Every copy as a shape of its own."""
        raise NotImplementedError

    @property
    def children(self) -> tuple[Shape, ...]:
        return (self.shape,)

    def distance(self, p: Floats) -> Floats:
        least = np.full(len(p), np.inf)
        for copy in self.copies():
            np.minimum(least, copy.distance(p), out=least)
        return least

    @cached_property
    def lipschitz(self) -> float:
        return self.shape.lipschitz

    @cached_property
    def accuracy(self) -> Accuracy:
        return weakest(self.shape.accuracy)

    def _declare(self) -> None:
        check(self)
        object.__setattr__(self, "dimension", of_shape(self.shape))


@dataclass(frozen=True)
class Repeated(Repetition):
    """Copies along X, Y and Z, all of them together around 0."""

    shape: Shape
    spacing: Vec3 = param((1.0, 1.0, 1.0), 0, None, "between copies", unit="m")
    counts: tuple[int, int, int] = param((3, 1, 1), 1, MOST_COPIES, "copies along X, Y and Z")

    def __post_init__(self) -> None:
        self._declare()
        if math.prod(self.counts) > MOST_COPIES:
            raise ParameterError(f"counts: {math.prod(self.counts)} copies are more than {MOST_COPIES}")
        if self.dimension == 2 and self.counts[2] > 1:
            raise ParameterError("counts: a flat shape has no copies along Z")

    @property
    def half(self) -> Floats:
        """From 0 to the middle of the last copy."""
        half: Floats = 0.5 * np.array(self.spacing) * (np.array(self.counts) - 1)
        return half

    def copies(self) -> tuple[Shape, ...]:
        places = (np.arange(n) * s - h for n, s, h in zip(self.counts, self.spacing, self.half, strict=True))
        return tuple(self.shape.at(float(x), float(y), float(z)) for x, y, z in itertools.product(*places))

    def extent(self, level: float) -> Box:
        low, high = self.shape.extent(level)
        return low - self.half, high + self.half


@dataclass(frozen=True)
class Polar(Repetition):
    """Copies turned about an axis through 0, evenly over a whole turn."""

    shape: Shape
    number: int = param(6, 1, MOST_COPIES, "copies")
    axis: Vec3 = param((0.0, 0.0, 1.0), doc="about which they are turned; any length")

    def __post_init__(self) -> None:
        self._declare()
        if not any(self.axis):
            raise ParameterError("axis: (0, 0, 0) is no direction")
        if self.dimension == 2 and any(self.axis[:2]):
            raise ParameterError("axis: a flat shape turns about Z only")

    def copies(self) -> tuple[Shape, ...]:
        turns = (rotation(2 * math.pi * i / self.number, self.axis) for i in range(self.number))
        return tuple(self.shape.transform(turn) if i else self.shape for i, turn in enumerate(turns))

    def extent(self, level: float) -> Box:
        boxes = np.array([copy.extent(level) for copy in self.copies()])
        return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


@dataclass(frozen=True)
class Cell(Modifier):
    """One of the copies that :class:`RepeatedForever` asks: of the place's own cell, or of a neighbour towards it.

    Its value jumps where the place passes to the next cell; only that of all of them together does not.
    """

    code: ClassVar[str] = "cell"
    warps: ClassVar[bool] = True
    adjusts: ClassVar[bool] = True
    continuous: ClassVar[bool] = False
    shape: Shape
    spacing: Vec3 = param((1.0, 1.0, 1.0), 0, None, "between copies; 0: none on this axis", unit="m")
    cap: float = param(1.0, doc="greatest value", unit="m")
    toward: tuple[int, int, int] = param((0, 0, 0), 0, 1, "1 for the neighbour on this axis")

    def enter(self, p: Floats) -> Floats:
        s = np.maximum(self.spacing, 1e-20)
        u = p - s * np.round(p / s)
        step = np.where(u >= 0, 1, -1) * np.array(self.toward) * s
        return np.where(np.array(self.spacing) > 0, u - step, p)

    def leave(self, d: Floats, p: Floats) -> Floats:
        return np.minimum(d, self.cap)

    def extent(self, level: float) -> Box:
        low, high = self.shape.extent(level)
        endless = np.array(self.spacing) > 0
        return np.where(endless, -np.inf, low), np.where(endless, np.inf, high)

    @cached_property
    def accuracy(self) -> Accuracy:
        return "bound"


@dataclass(frozen=True)
class RepeatedForever(Repetition):
    """Copies without end along some axes; see the module. A copy may reach into its neighbours' cells, but not
    through them."""

    opaque: ClassVar[bool] = True
    shape: Shape
    spacing: Vec3 = param((1.0, 1.0, 1.0), 0, None, "between copies; 0: none on this axis", unit="m")

    def __post_init__(self) -> None:
        self._declare()
        _some_spacing(self)
        if not self._within(0.0):
            low, high = self.shape.box
            reach = f"{_three(low)} to {_three(high)}"
            raise ParameterError(f"spacing: {_three(self.spacing)} is less than the shape reaches from 0: {reach}")
        if self.cap < LEAST_CAP * max(self.spacing):
            raise ParameterError(
                f"spacing: {_three(self.spacing)} leaves no room beyond what the shape reaches; "
                f"more than {LEAST_CAP:g} of it must be left"
            )

    def _within(self, level: float, cells: float = 1.0) -> bool:
        low, high = self.shape.extent(level)
        reach, s = np.maximum(-low, high), np.array(self.spacing)
        return bool((reach <= cells * s)[s > 0].all())

    @property
    def _fits(self) -> bool:
        """Whether no copy that is left out is ever the nearest."""
        return self.shape.accuracy != "bound" and self._within(0.0, 0.5)

    @cached_property
    def cap(self) -> float:
        """What no value is above; see the module."""
        if self._fits:
            return UNCAPPED
        low, high = 0.0, max(self.spacing)
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._within(middle) else (low, middle)
        return low

    def copies(self) -> tuple[Shape, ...]:
        choices = [(0, 1) if s > 0 else (0,) for s in self.spacing]
        return tuple(Cell(self.shape, self.spacing, self.cap, (x, y, z)) for x, y, z in itertools.product(*choices))

    def extent(self, level: float) -> Box:
        low, high = self.shape.extent(level)
        endless = np.array(self.spacing) > 0
        if level >= self.cap:
            return np.full(3, -np.inf), np.full(3, np.inf)
        return np.where(endless, -np.inf, low), np.where(endless, np.inf, high)

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside" if self._fits else "bound"


@dataclass(frozen=True)
class MirroredForever(Modifier):
    """Copies without end, every second one a mirror image. What reaches out of its cell is cut at the wall."""

    code: ClassVar[str] = "mirrored_forever"
    warps: ClassVar[bool] = True
    shape: Shape
    spacing: Vec3 = param((1.0, 1.0, 1.0), 0, None, "between copies; 0: none on this axis", unit="m")

    def __post_init__(self) -> None:
        Modifier.__post_init__(self)
        _some_spacing(self)

    def enter(self, p: Floats) -> Floats:
        s = np.maximum(self.spacing, 1e-20)
        u = p - 2 * s * np.round(p / (2 * s))
        return np.where(np.array(self.spacing) > 0, np.where(np.abs(u) > 0.5 * s, np.sign(u) * s - u, u), p)

    def extent(self, level: float) -> Box:
        low, high = self.shape.extent(level)
        endless = np.array(self.spacing) > 0
        return np.where(endless, -np.inf, low), np.where(endless, np.inf, high)

    @cached_property
    def accuracy(self) -> Accuracy:
        (low, high), half = self.shape.box, 0.5 * np.array(self.spacing)
        return at_a_wall(self.shape.accuracy, float(np.minimum(half + low, half - high)[half > 0].min()))


def _some_spacing(shape: RepeatedForever | MirroredForever) -> None:
    if not any(shape.spacing):
        raise ParameterError("spacing: 0 on all axes")
    if shape.dimension == 2 and shape.spacing[2]:
        raise ParameterError("spacing: a flat shape has no copies along Z")


def _three(values: Sequence[float] | Floats) -> str:
    return "(" + ", ".join(f"{v:g}" for v in values) + ")"


def repeat(
    shape: Shape, spacing: float | Sequence[float], count: int | Sequence[int] | None, mirrored: bool
) -> Repeated | RepeatedForever | MirroredForever:
    """As :meth:`tyndall.sdf.shape.Shape.repeat`."""
    flat = of_shape(shape) == 2
    x, y, z = _triple("spacing", spacing, 0.0 if flat else None)
    if count is None:
        return (MirroredForever if mirrored else RepeatedForever)(shape, (x, y, z))
    if mirrored:
        raise ParameterError("mirrored: only without end; leave out the count")
    i, j, k = _triple("count", count, 1 if flat else None)
    return Repeated(shape, (x, y, z), (i, j, k))


def _triple[T: float](what: str, values: T | Sequence[T], z: T | None) -> tuple[T, T, T]:
    """Three numbers from one or three; of one, the last is ``z`` where that is given."""
    if isinstance(values, (int, float, np.number)):
        one: T = values
        return one, one, one if z is None else z
    if not isinstance(values, (Sequence, np.ndarray)) or isinstance(values, str) or len(values) != 3:
        raise ParameterError(f"{what}: {values!r} is not one number or three")
    return values[0], values[1], values[2]


__all__ = ["Cell", "MirroredForever", "Polar", "Repeated", "RepeatedForever", "Repetition", "repeat"]
