"""Flat primitives, in the plane of x and y; ``profiles.wesl`` has each for the device.

They become solid by :meth:`tyndall.sdf.shape.Shape.extrude` and :meth:`tyndall.sdf.shape.Shape.revolve`. Formulas are
Quilez's (https://iquilezles.org/articles/distfunctions2d) where nothing else is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from tyndall.gpu.params import ParameterError, param
from tyndall.sdf.shape import Accuracy, Box, Floats, Primitive
from tyndall.sdf.solids import (
    SMALLEST,
    Vec2,
    bezier_box,
    bezier_distance,
    bitten,
    bitten_box,
    cap,
    ellipsoid_distance,
    length,
    not_thin,
    rhombus_distance,
    sector,
    triangle_distance,
)

_FAR = 1e18  # a half axis in the plane's missing direction, finite on the device


def flat(low: Sequence[float] | Floats, high: Sequence[float] | Floats) -> Box:
    """A box of the plane: without end along Z."""
    return np.array([*low, -np.inf]), np.array([*high, np.inf])


def around0(x: float, y: float) -> Box:
    """A box of these half sides around 0."""
    return flat((-x, -y), (x, y))


class Profile(Primitive):
    """A primitive of two dimensions."""

    dimension = 2
    module: ClassVar[str] = "package::sdf::profiles"
    measured: ClassVar[bool] = True


def folded(p: Floats) -> Floats:
    """(N, 2): (|x|, y)."""
    return np.stack([np.abs(p[:, 0]), p[:, 1]], axis=1)


def rectangle_distance(q: Floats) -> Floats:
    """Of places that are q beyond a rectangle's sides."""
    return length(np.maximum(q, 0)) + np.minimum(q.max(axis=1), 0)


@dataclass(frozen=True)
class Circle(Profile):
    """A disc."""

    code: ClassVar[str] = "circle"
    radius: float = param(1.0, SMALLEST, None, "radius", unit="m")

    def distance(self, p: Floats) -> Floats:
        return np.hypot(p[:, 0], p[:, 1]) - self.radius

    @property
    def corners(self) -> Box:
        return around0(self.radius, self.radius)


@dataclass(frozen=True)
class Ellipse(Profile):
    """An ellipse, as :func:`tyndall.sdf.solids.ellipsoid_distance`."""

    code: ClassVar[str] = "ellipse"
    radii: Vec2 = param((1.0, 0.5), SMALLEST, None, "half axes", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        not_thin(self.radii)

    def distance(self, p: Floats) -> Floats:
        return ellipsoid_distance(p * [1, 1, 0], np.array([*self.radii, _FAR]))

    @property
    def corners(self) -> Box:
        return around0(*self.radii)

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"


@dataclass(frozen=True)
class Rectangle(Profile):
    """A rectangle around 0."""

    code: ClassVar[str] = "rectangle"
    size: Vec2 = param((1.0, 1.0), SMALLEST, None, "whole sides", unit="m")

    def distance(self, p: Floats) -> Floats:
        return rectangle_distance(np.abs(p[:, :2]) - 0.5 * np.array(self.size))

    @property
    def corners(self) -> Box:
        return around0(0.5 * self.size[0], 0.5 * self.size[1])


@dataclass(frozen=True)
class RoundedRectangle(Profile):
    """A rectangle around 0 with round corners, each with its own radius."""

    code: ClassVar[str] = "rounded_rectangle"
    size: Vec2 = param((1.0, 1.0), SMALLEST, None, "whole sides", unit="m")
    radii: tuple[float, float, float, float] = param(
        (0.1, 0.1, 0.1, 0.1), 0, None, "of the corners at +x +y, +x −y, −x +y, −x −y", unit="m"
    )

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if 2 * max(self.radii) > min(self.size):
            raise ParameterError(f"radii: {max(self.radii):g} is more than half the shortest side")

    def distance(self, p: Floats) -> Floats:
        right, up = p[:, 0] > 0, p[:, 1] > 0
        a, b, c, d = self.radii
        r = np.where(right, np.where(up, a, b), np.where(up, c, d))
        return rectangle_distance(np.abs(p[:, :2]) - 0.5 * np.array(self.size) + r[:, None]) - r

    @property
    def corners(self) -> Box:
        return around0(0.5 * self.size[0], 0.5 * self.size[1])


@dataclass(frozen=True)
class Bar(Profile):
    """A rectangle along a line."""

    code: ClassVar[str] = "bar"
    a: Vec2 = param((-0.5, 0.0), doc="middle of one end", unit="m")
    b: Vec2 = param((0.5, 0.0), doc="middle of the other", unit="m")
    width: float = param(0.2, SMALLEST, None, "across the line", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if math.dist(self.a, self.b) < SMALLEST:
            raise ParameterError("bar: its ends are one place")

    def distance(self, p: Floats) -> Floats:
        along = np.subtract(self.b, self.a)
        half = 0.5 * float(np.linalg.norm(along))
        u = along / (2 * half)
        q = p[:, :2] - 0.5 * np.add(self.a, self.b)
        beyond = np.stack([np.abs(q @ u) - half, np.abs(q @ [-u[1], u[0]]) - 0.5 * self.width], axis=1)
        return rectangle_distance(beyond)

    @property
    def corners(self) -> Box:
        along = np.subtract(self.b, self.a) / math.dist(self.a, self.b)
        wide = 0.5 * self.width * np.abs(along[::-1])
        return flat(np.minimum(self.a, self.b) - wide, np.maximum(self.a, self.b) + wide)


@dataclass(frozen=True)
class Segment(Profile):
    """All places within a radius of a line."""

    code: ClassVar[str] = "segment"
    a: Vec2 = param((-0.5, 0.0), doc="one end", unit="m")
    b: Vec2 = param((0.5, 0.0), doc="the other end", unit="m")
    radius: float = param(0.1, SMALLEST, None, "half the thickness", unit="m")

    def distance(self, p: Floats) -> Floats:
        pa, ba = p[:, :2] - np.array(self.a), np.subtract(self.b, self.a)
        h = np.clip(pa @ ba / max(float(ba @ ba), 1e-20), 0, 1)
        return length(pa - h[:, None] * ba) - self.radius

    @property
    def corners(self) -> Box:
        return flat(np.minimum(self.a, self.b) - self.radius, np.maximum(self.a, self.b) + self.radius)


@dataclass(frozen=True)
class UnevenCapsule(Profile):
    """Two discs, one at 0 and one above it, and what lies between."""

    code: ClassVar[str] = "uneven_capsule"
    bottom: float = param(0.5, SMALLEST, None, "radius of the disc at 0", unit="m")
    top: float = param(0.25, SMALLEST, None, "radius of the other", unit="m")
    height: float = param(1.0, SMALLEST, None, "of its middle", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if self.height <= abs(self.bottom - self.top):
            raise ParameterError("uneven_capsule: one disc holds the other; use a circle")

    def distance(self, p: Floats) -> Floats:
        x, y, h = np.abs(p[:, 0]), p[:, 1], self.height
        sine = (self.bottom - self.top) / h
        cosine = math.sqrt(1 - sine * sine)
        k = cosine * y - sine * x
        between, top = cosine * x + sine * y - self.bottom, np.hypot(x, y - h) - self.top
        return np.where(k < 0, np.hypot(x, y) - self.bottom, np.where(k > cosine * h, top, between))

    @property
    def corners(self) -> Box:
        wide = max(self.bottom, self.top)
        low, high = min(-self.bottom, self.height - self.top), max(self.bottom, self.height + self.top)
        return flat((-wide, low), (wide, high))


@dataclass(frozen=True)
class Rhombus(Profile):
    """A rhombus around 0."""

    code: ClassVar[str] = "rhombus"
    size: Vec2 = param((1.0, 0.6), SMALLEST, None, "whole diagonals", unit="m")

    def distance(self, p: Floats) -> Floats:
        return rhombus_distance(p, self.size)

    @property
    def corners(self) -> Box:
        return around0(0.5 * self.size[0], 0.5 * self.size[1])


@dataclass(frozen=True)
class Trapezoid(Profile):
    """A trapezoid with two level sides."""

    code: ClassVar[str] = "trapezoid"
    bottom: float = param(1.0, 0, None, "whole side at −height/2", unit="m")
    top: float = param(0.5, 0, None, "whole side at +height/2", unit="m")
    height: float = param(0.6, SMALLEST, None, "along Y", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if self.bottom + self.top < SMALLEST:
            raise ParameterError("trapezoid: both sides are 0")

    def distance(self, p: Floats) -> Floats:
        low, high, h = 0.5 * self.bottom, 0.5 * self.top, 0.5 * self.height
        q = folded(p)  # one half, whose left side is inside and so never nearest
        w, e = q - [low, -h], np.array([high - low, 2 * h])
        slope = length(w - e * np.clip(w @ e / (e @ e), 0, 1)[:, None])
        away, beyond = np.maximum(q[:, 0] - np.where(q[:, 1] < 0, low, high), 0), np.abs(q[:, 1]) - h
        d = np.minimum(slope, np.hypot(away, beyond))
        return np.where((e[0] * w[:, 1] > e[1] * w[:, 0]) & (beyond < 0), -d, d)

    @property
    def corners(self) -> Box:
        return around0(0.5 * max(self.bottom, self.top), 0.5 * self.height)


@dataclass(frozen=True)
class Parallelogram(Profile):
    """A parallelogram with two level sides."""

    code: ClassVar[str] = "parallelogram"
    width: float = param(1.0, SMALLEST, None, "of the level sides", unit="m")
    height: float = param(0.6, SMALLEST, None, "along Y", unit="m")
    skew: float = param(0.3, doc="how far the top is to the right of the bottom", unit="m")

    def distance(self, p: Floats) -> Floats:
        w, h, s = 0.5 * self.width, 0.5 * self.height, 0.5 * self.skew
        return polygon_distance(p, ((-w - s, -h), (w - s, -h), (w + s, h), (-w + s, h)))

    @property
    def corners(self) -> Box:
        return around0(0.5 * (self.width + abs(self.skew)), 0.5 * self.height)


@dataclass(frozen=True)
class Triangle(Profile):
    """A triangle by its corners, in either order."""

    code: ClassVar[str] = "triangle"
    a: Vec2 = param((-0.5, -0.5), doc="a corner", unit="m")
    b: Vec2 = param((0.5, -0.5), doc="a corner", unit="m")
    c: Vec2 = param((0.0, 0.5), doc="a corner", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        _no_flat(self.code, (self.a, self.b, self.c))

    def distance(self, p: Floats) -> Floats:
        return triangle_distance(p[:, :2], self.a, self.b, self.c)

    @property
    def corners(self) -> Box:
        points = np.array([self.a, self.b, self.c])
        return flat(points.min(axis=0), points.max(axis=0))


@dataclass(frozen=True)
class Isosceles(Profile):
    """A triangle with its tip at 0 and its base above or below it, across Y."""

    code: ClassVar[str] = "isosceles"
    width: float = param(1.0, SMALLEST, None, "of the base", unit="m")
    height: float = param(-1.0, doc="of the base, below 0 where negative", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if abs(self.height) < SMALLEST:
            raise ParameterError("height: the base is at the tip")

    def distance(self, p: Floats) -> Floats:
        w, h = 0.5 * self.width, self.height
        return triangle_distance(p[:, :2], (0.0, 0.0), (w, h), (-w, h))

    @property
    def corners(self) -> Box:
        return flat((-0.5 * self.width, min(0.0, self.height)), (0.5 * self.width, max(0.0, self.height)))


@dataclass(frozen=True)
class Quad(Profile):
    """A polygon of four corners that does not cross itself, convex or not."""

    code: ClassVar[str] = "quad"
    a: Vec2 = param((-0.5, -0.5), doc="a corner", unit="m")
    b: Vec2 = param((0.5, -0.5), doc="the next", unit="m")
    c: Vec2 = param((0.4, 0.5), doc="the next", unit="m")
    d: Vec2 = param((-0.4, 0.3), doc="the last", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        _no_flat(self.code, (self.a, self.b, self.c, self.d))

    def distance(self, p: Floats) -> Floats:
        return polygon_distance(p, (self.a, self.b, self.c, self.d))

    @property
    def corners(self) -> Box:
        points = np.array([self.a, self.b, self.c, self.d])
        return flat(points.min(axis=0), points.max(axis=0))


def _no_flat(name: str, points: Sequence[Vec2]) -> None:
    """An area, and no side without length."""
    v = np.array(points)
    after = np.roll(v, -1, axis=0)
    if abs(float((v[:, 0] * after[:, 1] - v[:, 1] * after[:, 0]).sum())) < SMALLEST**2:
        raise ParameterError(f"{name}: its corners lie in a line")
    if (length(after - v) < SMALLEST).any():
        raise ParameterError(f"{name}: two corners are one place")


def polygon_distance(p: Floats, points: Sequence[Vec2]) -> Floats:
    """A polygon that does not cross itself, by the parity of the sides above a place."""
    v = np.array(points)
    e = np.roll(v, -1, axis=0) - v
    w = p[:, None, :2] - v
    h = np.clip((w * e).sum(axis=2) / (e * e).sum(axis=1), 0, 1)
    d = length(w - e * h[..., None]).min(axis=1)
    above, below = w[..., 1] >= 0, w[..., 1] < e[:, 1]
    left = e[:, 0] * w[..., 1] > e[:, 1] * w[..., 0]
    turns = (above & below & left) | ~(above | below | left)
    return np.where(turns.sum(axis=1) % 2 == 1, -d, d)


@dataclass(frozen=True)
class Regular(Profile):
    """A regular polygon with a corner on +Y."""

    code: ClassVar[str] = "regular"
    sides: int = param(5, 3, 1000, "how many")
    radius: float = param(1.0, SMALLEST, None, "of the circle through the corners", unit="m")

    def distance(self, p: Floats) -> Floats:
        return star_distance(p, self.sides, self.radius, self.radius * math.cos(math.pi / self.sides))

    @property
    def corners(self) -> Box:
        return tips_box(self.sides, self.radius)


@dataclass(frozen=True)
class Star(Profile):
    """A star with a tip on +Y."""

    code: ClassVar[str] = "star"
    tips: int = param(5, 2, 1000, "how many")
    radius: float = param(1.0, SMALLEST, None, "of the circle through the tips", unit="m")
    inner: float = param(0.4, SMALLEST, None, "of the circle through the corners between", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if self.inner > self.radius:
            raise ParameterError(f"inner: {self.inner:g} is more than the radius")

    def distance(self, p: Floats) -> Floats:
        return star_distance(p, self.tips, self.radius, self.inner)

    @property
    def corners(self) -> Box:
        # The corners between stand out only where there are few tips.
        turn = 2 * math.pi * np.arange(self.tips) / self.tips
        tips = np.stack([np.sin(turn), np.cos(turn)], axis=1) * self.radius
        turn += math.pi / self.tips
        points = np.concatenate([tips, np.stack([np.sin(turn), np.cos(turn)], axis=1) * self.inner])
        return flat(points.min(axis=0), points.max(axis=0))


def star_distance(p: Floats, tips: int, outer: float, inner: float) -> Floats:
    """Turned and mirrored into the sector of one half tip, of which one side is nearest."""
    step = math.pi / tips
    turn = -2 * step * np.round(np.arctan2(p[:, 0], p[:, 1]) / (2 * step))
    s, c = np.sin(turn), np.cos(turn)
    q = np.stack([np.abs(c * p[:, 0] + s * p[:, 1]), c * p[:, 1] - s * p[:, 0]], axis=1)
    e = np.array([inner * math.sin(step), inner * math.cos(step) - outer])
    w = q - np.array([0.0, outer])
    h = np.clip(w @ e / (e @ e), 0, 1)
    d = length(w - h[:, None] * e)
    return np.where(e[0] * w[:, 1] > e[1] * w[:, 0], d, -d)


def tips_box(tips: int, radius: float) -> Box:
    turn = 2 * math.pi * np.arange(tips) / tips
    points = np.stack([np.sin(turn), np.cos(turn)], axis=1) * radius
    return flat(points.min(axis=0), points.max(axis=0))


@dataclass(frozen=True)
class Pie(Profile):
    """A disc's sector to both sides of +Y."""

    code: ClassVar[str] = "pie"
    angle: float = param(0.8, 0.01, math.pi - 0.01, "between +Y and a side", unit="rad")
    radius: float = param(1.0, SMALLEST, None, "of the disc", unit="m")

    @property
    def numbers(self) -> tuple[float, ...]:
        return math.sin(self.angle), math.cos(self.angle), self.radius

    def distance(self, p: Floats) -> Floats:
        return sector(folded(p), np.array([math.sin(self.angle), math.cos(self.angle)]), self.radius)

    @property
    def corners(self) -> Box:
        wide = self.radius * math.sin(min(self.angle, math.pi / 2))
        return flat((-wide, min(0.0, self.radius * math.cos(self.angle))), (wide, self.radius))


@dataclass(frozen=True)
class CutDisk(Profile):
    """What of a disc is above a height."""

    code: ClassVar[str] = "cut_disk"
    radius: float = param(1.0, SMALLEST, None, "of the disc", unit="m")
    height: float = param(0.0, doc="of the cut, −radius … radius", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if abs(self.height) >= self.radius:
            raise ParameterError("cut_disk: the cut at this height misses the disc")

    def distance(self, p: Floats) -> Floats:
        return cap(folded(p), self.radius, self.height)

    @property
    def corners(self) -> Box:
        wide = self.radius if self.height <= 0 else math.sqrt(self.radius**2 - self.height**2)
        return flat((-wide, self.height), (wide, self.radius))


@dataclass(frozen=True)
class Arc(Profile):
    """An arc of a ring with round ends, to both sides of +Y."""

    code: ClassVar[str] = "arc"
    angle: float = param(2.0, 0, math.pi, "from +Y to an end", unit="rad")
    radius: float = param(1.0, SMALLEST, None, "of the middle of the ring", unit="m")
    width: float = param(0.2, SMALLEST, None, "across the ring", unit="m")

    @property
    def numbers(self) -> tuple[float, ...]:
        return math.sin(self.angle), math.cos(self.angle), self.radius, 0.5 * self.width

    def distance(self, p: Floats) -> Floats:
        s, c = math.sin(self.angle), math.cos(self.angle)
        x, y = np.abs(p[:, 0]), p[:, 1]
        end = np.hypot(x - self.radius * s, y - self.radius * c)
        return np.where(c * x > s * y, end, np.abs(np.hypot(x, y) - self.radius)) - 0.5 * self.width

    @property
    def corners(self) -> Box:
        wide, t = self.radius * math.sin(min(self.angle, math.pi / 2)), 0.5 * self.width
        return flat((-wide - t, self.radius * math.cos(self.angle) - t), (wide + t, self.radius + t))

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"  # its ends may meet


@dataclass(frozen=True)
class Ring(Profile):
    """A ring."""

    code: ClassVar[str] = "ring"
    radius: float = param(1.0, SMALLEST, None, "of its middle", unit="m")
    width: float = param(0.2, SMALLEST, None, "across", unit="m")

    def distance(self, p: Floats) -> Floats:
        return np.abs(np.hypot(p[:, 0], p[:, 1]) - self.radius) - 0.5 * self.width

    @property
    def corners(self) -> Box:
        return around0(self.radius + 0.5 * self.width, self.radius + 0.5 * self.width)

    @cached_property
    def accuracy(self) -> Accuracy:
        return "exact" if 0.5 * self.width <= self.radius else "outside"


@dataclass(frozen=True)
class Horseshoe(Profile):
    """An arc of a ring to both sides of +Y, with straight legs."""

    code: ClassVar[str] = "horseshoe"
    angle: float = param(1.6, 0.01, math.pi - 0.01, "from +Y to where a leg begins", unit="rad")
    radius: float = param(1.0, SMALLEST, None, "of the middle of the ring", unit="m")
    legs: float = param(0.5, 0, None, "length of a leg", unit="m")
    width: float = param(0.3, SMALLEST, None, "across", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if self.width > 2 * self.radius:
            raise ParameterError(f"width: {self.width:g} is more than twice the radius")

    @property
    def numbers(self) -> tuple[float, ...]:
        return math.sin(self.angle), math.cos(self.angle), self.radius, self.legs, 0.5 * self.width

    def distance(self, p: Floats) -> Floats:
        s, c = math.sin(self.angle), math.cos(self.angle)
        x, y = np.abs(p[:, 0]), p[:, 1]
        along, across = x * c - y * s, x * s + y * c
        leg = np.stack([along - self.legs, np.abs(across - self.radius) - 0.5 * self.width], axis=1)
        # Inside of the ring the leg's end may be nearer than a wall.
        ring = np.maximum(np.abs(np.hypot(x, y) - self.radius) - 0.5 * self.width, along - self.legs)
        return np.where(along > 0, rectangle_distance(leg), ring)

    @property
    def _ends(self) -> Floats:
        """(4, 2): the corners of the leg on the right, in order."""
        s, c = math.sin(self.angle), math.cos(self.angle)
        outer = self.radius + 0.5 * self.width
        inner = outer - self.width
        around = ((outer, 0.0), (outer, self.legs), (inner, self.legs), (inner, 0.0))
        return np.array([[r * s + u * c, r * c - u * s] for r, u in around])

    @property
    def corners(self) -> Box:
        outer, ends = self.radius + 0.5 * self.width, self._ends
        after = np.roll(ends, -1, axis=0)
        cut = ends[:, 0] * after[:, 0] < 0  # sides that cross the middle, where they end
        at = ends[cut, :1] / (ends[cut, :1] - after[cut, :1])
        ends = np.concatenate([ends[ends[:, 0] >= 0], ends[cut] + (after[cut] - ends[cut]) * at])
        wide = max(float(ends[:, 0].max()), outer if self.angle >= math.pi / 2 else 0.0)
        return flat((-wide, float(ends[:, 1].min())), (wide, outer))

    def extent(self, level: float) -> Box:
        low, high = super().extent(level)
        if level > 0:  # what is cut off still tells its distance
            low[1] = min(low[1], float(self._ends[:, 1].min()) - level)
        return low, high

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside" if self._ends[:, 0].min() >= 0 else "bound"  # legs that cross are cut where they do


@dataclass(frozen=True)
class Lens(Profile):
    """What two discs have in common: a vesica with its tips on ±Y."""

    code: ClassVar[str] = "lens"
    width: float = param(0.6, SMALLEST, None, "along X", unit="m")
    height: float = param(1.0, SMALLEST, None, "between the tips, along Y", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if self.width > self.height:
            raise ParameterError("lens: wider than high; turn it")

    def distance(self, p: Floats) -> Floats:
        x, y, w, h = np.abs(p[:, 0]), np.abs(p[:, 1]), 0.5 * self.width, 0.5 * self.height
        d = 0.5 * (h * h - w * w) / w
        return np.where(h * x < d * (y - h), np.hypot(x, y - h), np.hypot(x + d, y) - (d + w))

    @property
    def corners(self) -> Box:
        return around0(0.5 * self.width, 0.5 * self.height)


@dataclass(frozen=True)
class Moon(Profile):
    """A disc without another whose middle lies on +Y."""

    code: ClassVar[str] = "moon"
    radius: float = param(1.0, SMALLEST, None, "of the disc", unit="m")
    bite: float = param(0.8, SMALLEST, None, "radius of what is taken away", unit="m")
    away: float = param(0.7, SMALLEST, None, "of its middle from the disc's", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if not abs(self.radius - self.bite) < self.away < self.radius + self.bite:
            raise ParameterError("moon: the two circles do not meet")

    def distance(self, p: Floats) -> Floats:
        return bitten(folded(p), self.radius, self.bite, self.away)

    @property
    def corners(self) -> Box:
        return flat(*bitten_box(self.radius, self.bite, self.away))

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"


@dataclass(frozen=True)
class Egg(Profile):
    """An egg: a half disc below 0, its sides of twice the difference of the radii and the lesser."""

    code: ClassVar[str] = "egg"
    bottom: float = param(0.6, SMALLEST, None, "radius of the half disc", unit="m")
    top: float = param(0.2, SMALLEST, None, "radius at the top", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if self.top >= self.bottom:
            raise ParameterError("top: not less than the bottom")

    def distance(self, p: Floats) -> Floats:
        x, y, k, r = np.abs(p[:, 0]), p[:, 1], math.sqrt(3), self.bottom - self.top
        high = np.where(k * (x + r) < y, np.hypot(x, y - k * r), np.hypot(x + r, y) - 2 * r)
        return np.where(y < 0, np.hypot(x, y) - r, high) - self.top

    @property
    def corners(self) -> Box:
        tall = math.sqrt(3) * (self.bottom - self.top) + self.top
        return flat((-self.bottom, -self.bottom), (self.bottom, tall))


@dataclass(frozen=True)
class Heart(Profile):
    """A heart with its point at 0."""

    code: ClassVar[str] = "heart"
    size: float = param(1.0, SMALLEST, None, "of the square in it, corner to corner", unit="m")

    def distance(self, p: Floats) -> Floats:
        x, y = np.abs(p[:, 0]) / self.size, p[:, 1] / self.size
        lobe = np.hypot(x - 0.25, y - 0.75) - math.sqrt(2) / 4
        m = 0.5 * np.maximum(x + y, 0)
        low = np.minimum(np.hypot(x, y - 1), np.hypot(x - m, y - m))
        return self.size * np.where(x + y > 1, lobe, np.where(x > y, low, -low))

    @property
    def corners(self) -> Box:
        r = math.sqrt(2) / 4
        return flat((-(0.25 + r) * self.size, 0.0), ((0.25 + r) * self.size, (0.75 + r) * self.size))


@dataclass(frozen=True)
class Cross(Profile):
    """Two bars across each other."""

    code: ClassVar[str] = "plus"
    size: float = param(1.0, SMALLEST, None, "whole length of a bar", unit="m")
    width: float = param(0.3, SMALLEST, None, "across a bar", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if self.width > self.size:
            raise ParameterError("width: more than the length")

    def distance(self, p: Floats) -> Floats:
        q = np.abs(p[:, :2])
        q = np.stack([q.max(axis=1) - 0.5 * self.size, q.min(axis=1) - 0.5 * self.width], axis=1)
        return rectangle_distance(q)

    @property
    def corners(self) -> Box:
        return around0(0.5 * self.size, 0.5 * self.size)

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"


@dataclass(frozen=True)
class Curve(Profile):
    """All places within a radius of a quadratic Bézier curve; see :func:`tyndall.sdf.solids.bezier_distance`."""

    code: ClassVar[str] = "curve"
    a: Vec2 = param((-0.5, 0.0), doc="where it begins", unit="m")
    b: Vec2 = param((0.0, 0.5), doc="what it bends towards", unit="m")
    c: Vec2 = param((0.5, 0.0), doc="where it ends", unit="m")
    radius: float = param(0.1, SMALLEST, None, "half the thickness", unit="m")

    def distance(self, p: Floats) -> Floats:
        return bezier_distance(p * [1, 1, 0], self.a, self.b, self.c) - self.radius

    @property
    def corners(self) -> Box:
        low, high = bezier_box(self.a, self.b, self.c)
        return flat(low - self.radius, high + self.radius)

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"


@dataclass(frozen=True)
class HalfPlane(Profile):
    """All that is below a line."""

    code: ClassVar[str] = "half_plane"
    normal: Vec2 = param((0.0, 1.0), doc="out of what is solid; any length")
    offset: float = param(0.0, doc="of the line from 0 along the normal", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if not any(self.normal):
            raise ParameterError("normal: (0, 0) is no direction")

    @property
    def numbers(self) -> tuple[float, ...]:
        size = math.hypot(*self.normal)
        return self.normal[0] / size, self.normal[1] / size, self.offset

    def distance(self, p: Floats) -> Floats:
        x, y, offset = self.numbers
        return x * p[:, 0] + y * p[:, 1] - offset

    @property
    def corners(self) -> Box:
        x, y, offset = self.numbers
        low, high = np.full(2, -np.inf), np.full(2, np.inf)
        for axis, along in enumerate((x, y)):
            if abs(along) == 1:
                (high if along > 0 else low)[axis] = along * offset
        return flat(low, high)


_ALL: tuple[type[Profile], ...] = (
    Circle, Ellipse, Rectangle, RoundedRectangle, Bar, Segment, UnevenCapsule, Rhombus, Trapezoid, Parallelogram,
    Triangle, Isosceles, Quad, Regular, Star, Pie, CutDisk, Arc, Ring, Horseshoe, Lens, Moon, Egg, Heart, Cross, Curve,
    HalfPlane,
)  # fmt: skip
PROFILES: dict[str, type[Profile]] = {cls.code: cls for cls in _ALL}


# --- as they are written ---


def circle(radius: float = 1.0) -> Circle:
    """A disc around 0; see :class:`Circle`."""
    return Circle(radius)


def ellipse(radii: Vec2 = (1.0, 0.5)) -> Ellipse:
    """An ellipse around 0 by its half axes; see :class:`Ellipse`."""
    return Ellipse(radii)


def rectangle(size: float | Vec2 = 1.0) -> Rectangle:
    """A rectangle around 0 by its whole sides, or a square; see :class:`Rectangle`."""
    return Rectangle(_sides(size))


def rounded_rectangle(
    size: float | Vec2 = 1.0, radius: float | tuple[float, float, float, float] = 0.1
) -> RoundedRectangle:
    """A rectangle with round corners; see :class:`RoundedRectangle`."""
    return RoundedRectangle(_sides(size), (radius,) * 4 if isinstance(radius, (int, float)) else radius)


def bar(a: Vec2 = (-0.5, 0.0), b: Vec2 = (0.5, 0.0), width: float = 0.2) -> Bar:
    """A rectangle along a line; see :class:`Bar`."""
    return Bar(a, b, width)


def segment(a: Vec2 = (-0.5, 0.0), b: Vec2 = (0.5, 0.0), radius: float = 0.1) -> Segment:
    """A thick line with round ends; see :class:`Segment`."""
    return Segment(a, b, radius)


def uneven_capsule(bottom: float = 0.5, top: float = 0.25, height: float = 1.0) -> UnevenCapsule:
    """Two discs and what lies between; see :class:`UnevenCapsule`."""
    return UnevenCapsule(bottom, top, height)


def rhombus(size: Vec2 = (1.0, 0.6)) -> Rhombus:
    """A rhombus by its diagonals; see :class:`Rhombus`."""
    return Rhombus(size)


def trapezoid(bottom: float = 1.0, top: float = 0.5, height: float = 0.6) -> Trapezoid:
    """See :class:`Trapezoid`."""
    return Trapezoid(bottom, top, height)


def parallelogram(width: float = 1.0, height: float = 0.6, skew: float = 0.3) -> Parallelogram:
    """See :class:`Parallelogram`."""
    return Parallelogram(width, height, skew)


def polygon(*points: Vec2) -> Triangle | Quad:
    """A polygon of three or four corners; see :class:`Triangle` and :class:`Quad`."""
    if len(points) == 3:
        return Triangle(*points)
    if len(points) == 4:
        return Quad(*points)
    if len(points) == 1:
        raise ParameterError("polygon: its corners are given one by one, polygon((x, y), (x, y), (x, y))")
    raise ParameterError(f"polygon: {len(points)} corners; unite polygons of 3 or 4")


def isosceles(width: float = 1.0, height: float = -1.0) -> Isosceles:
    """A triangle with its tip at 0; see :class:`Isosceles`."""
    return Isosceles(width, height)


def regular(sides: int, radius: float = 1.0) -> Regular:
    """A regular polygon with a corner on +Y; see :class:`Regular`."""
    return Regular(sides, radius)


def triangle(radius: float = 1.0) -> Regular:
    """An equilateral triangle with a corner on +Y (:func:`polygon` takes any corners)."""
    return Regular(3, radius)


def pentagon(radius: float = 1.0) -> Regular:
    """A regular pentagon with a corner on +Y."""
    return Regular(5, radius)


def hexagon(radius: float = 1.0) -> Regular:
    """A regular hexagon with a corner on +Y."""
    return Regular(6, radius)


def octagon(radius: float = 1.0) -> Regular:
    """A regular octagon with a corner on +Y."""
    return Regular(8, radius)


def star(tips: int = 5, radius: float = 1.0, inner: float = 0.4) -> Star:
    """A star with a tip on +Y; see :class:`Star`."""
    return Star(tips, radius, inner)


def pie(angle: float = 0.8, radius: float = 1.0) -> Pie:
    """A disc's sector; see :class:`Pie`."""
    return Pie(angle, radius)


def cut_disk(radius: float = 1.0, height: float = 0.0) -> CutDisk:
    """A disc above a height; see :class:`CutDisk`."""
    return CutDisk(radius, height)


def arc(angle: float = 2.0, radius: float = 1.0, width: float = 0.2) -> Arc:
    """A ring's arc with round ends; see :class:`Arc`."""
    return Arc(angle, radius, width)


def ring(radius: float = 1.0, width: float = 0.2) -> Ring:
    """A ring; see :class:`Ring`."""
    return Ring(radius, width)


def horseshoe(angle: float = 1.6, radius: float = 1.0, legs: float = 0.5, width: float = 0.3) -> Horseshoe:
    """A ring's arc with straight legs; see :class:`Horseshoe`."""
    return Horseshoe(angle, radius, legs, width)


def lens(width: float = 0.6, height: float = 1.0) -> Lens:
    """A vesica; see :class:`Lens`."""
    return Lens(width, height)


def moon(radius: float = 1.0, bite: float = 0.8, away: float = 0.7) -> Moon:
    """A disc with a bite taken out; see :class:`Moon`."""
    return Moon(radius, bite, away)


def egg(bottom: float = 0.6, top: float = 0.2) -> Egg:
    """See :class:`Egg`."""
    return Egg(bottom, top)


def heart(size: float = 1.0) -> Heart:
    """See :class:`Heart`."""
    return Heart(size)


def cross(size: float = 1.0, width: float = 0.3) -> Cross:
    """Two bars across each other; see :class:`Cross`."""
    return Cross(size, width)


def curve(a: Vec2 = (-0.5, 0.0), b: Vec2 = (0.0, 0.5), c: Vec2 = (0.5, 0.0), radius: float = 0.1) -> Curve:
    """A thick quadratic Bézier curve; see :class:`Curve`."""
    return Curve(a, b, c, radius)


def half_plane(normal: Vec2 = (0.0, 1.0), offset: float = 0.0) -> HalfPlane:
    """All below a line; see :class:`HalfPlane`."""
    return HalfPlane(normal, offset)


def _sides(size: float | Vec2) -> Vec2:
    return (size, size) if isinstance(size, (int, float)) else size
