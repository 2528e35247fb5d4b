"""Solid primitives; ``solids.wesl`` has each for the device.

Those with an axis have it along +Z, around 0 unless they say otherwise (:meth:`tyndall.sdf.shape.Shape.orient` turns
it). Formulas are Quilez's (https://iquilezles.org/articles/distfunctions) where nothing else is said, written so that
they lose no digits near the surface. The regular polyhedra are folded by the mirrors of their symmetry into one
chamber, in which a single edge is nearest.

Each has S5's id, 0 … 31, but for the last few, which S5 leaves no room for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from tyndall.gpu.params import ParameterError, param
from tyndall.sdf.shape import Accuracy, Box, Floats, Primitive, Shape, Transformed, Vec3

Vec2 = tuple[float, float]
SMALLEST = 1e-6  # of a length that is not 0, in metres


def centred(half: Floats | Sequence[float]) -> Box:
    """The box of these half sides around 0."""
    high = np.asarray(half, np.float64)
    return -high, high.copy()


def around(points: Sequence[Vec3], radii: Sequence[float]) -> Box:
    """The box of balls."""
    centres, r = np.array(points), np.array(radii)[:, None]
    return (centres - r).min(axis=0), (centres + r).max(axis=0)


def radial(p: Floats) -> Floats:
    """(N, 2): distance from the axis of Z, and z."""
    return np.stack([np.hypot(p[:, 0], p[:, 1]), p[:, 2]], axis=1)


def length(v: Floats) -> Floats:
    """Of vectors in the last axis."""
    result: Floats = np.linalg.norm(v, axis=-1)
    return result


def prism(d: Floats, beyond: Floats) -> Floats:
    """A profile's distances d made solid: ``beyond`` is how far a place is above or below its two ends."""
    return np.minimum(np.maximum(d, beyond), 0) + np.hypot(np.maximum(d, 0), np.maximum(beyond, 0))


def side(q: Floats, apothem: float, half: float) -> Floats:
    """Distance from one side of a regular polygon, y = apothem, |x| ≤ half, in the side's own sector."""
    away = q[:, 1] - apothem
    return np.where(away > 0, np.hypot(np.maximum(np.abs(q[:, 0]) - half, 0), away), away)


def mirrored(q: Floats, normal: Sequence[float]) -> Floats:
    """What is behind a plane through 0 reflected to its front."""
    n = np.array(normal)
    result: Floats = q - 2 * np.minimum(q @ n, 0)[:, None] * n
    return result


def face(p: Floats, normal: Vec3, out: Vec3, along: Vec3, height: float, apothem: float, half: float) -> Floats:
    """Distance from a polyhedron's face in the chamber of one of its edges: the face's normal and height above 0; the
    direction out over the edge and its distance from the face's middle; the direction along the edge and half its
    length."""
    h: Floats = p @ np.array(normal) - height
    u: Floats = p @ np.array(out) - apothem
    v: Floats = np.maximum(np.abs(p @ np.array(along)) - half, 0)
    return np.where((h > 0) & (u > 0), np.sqrt(h * h + u * u + v * v), h)


def ellipsoid_distance(p: Floats, radii: Floats) -> Floats:
    """Signed distance from an ellipsoid, exact outside and rmin (|p/r| − 1), which is less in size, inside.

    Outside, the nearest place is r² p / (t + r²), t the root of m(t) = |s| = 1, s = r p / (t + r²). That t makes
    t (Σ p² / (t + r²) − 1) greatest, which is then the distance squared (the dual of the least distance; Boyd and
    Vandenberghe: *Convex Optimization*, 2004, § 5). So an error of t counts by its square only; and of what is missing
    at a t, the integral of m² − 1 up to the root, most is known: all of it where 1/m is straight, as it is for a ball,
    and with its curvature the next order too. Few steps (Chebyshev's, of third order) are left: with what the device's
    float32 ask for, one to three. They begin at the greater of what one component alone asks for, and of what a ball
    of the greatest radius would.
    """
    r2 = radii * radii
    q = np.abs(p)
    t = np.maximum(0, np.maximum((radii * q - r2).max(axis=1), length(radii * q) - r2.max()))
    k = length(q / radii)
    outside = k > 1
    q = np.where(outside[:, None], q, 2 * radii)  # any place that is safe to divide by
    d2 = np.zeros(len(p))
    for _ in range(ELLIPSOID_STEPS):
        w = 1 / (t[:, None] + r2)
        s = radii * q * w
        m = length(s)
        falls = (s * s * w).sum(axis=1)
        away, step = m - 1, (m - 1) * m * m / falls
        bend = np.maximum(1.5 * away * (1 - (s * s * w * w).sum(axis=1) * m * m / falls**2), -0.5)
        d2 = t * ((q * q * w).sum(axis=1) - 1) + away * step * (1 - 2 / 3 * bend / m)
        t = np.maximum(t + step * (1 - bend), 0)
    return np.where(outside, np.sqrt(np.maximum(d2, 0)), radii.min() * (k - 1))


ELLIPSOID_STEPS = 7  # rounding, for half axes of 1 : 100
THINNEST = 0.01


def not_thin(radii: Sequence[float]) -> None:
    """Raises:
    ParameterError: half axes for which these steps are too few."""
    if min(radii) < THINNEST * max(radii):
        raise ParameterError("radii: one is less than a hundredth of another; scale a sphere")


def bezier_distance(p: Floats, a: Vec2, b: Vec2, c: Vec2) -> Floats:
    """Distance (N,) of places (N, 3) from a quadratic Bézier curve in the plane of x and y.

    The derivative of the squared distance is a cubic in t that rises, falls and rises. It is concave on the way to its
    inflection and convex after it, so Newton's steps from 0 and from 1 reach the two least distances without passing.
    """
    start, bend = np.array([*b, 0.0]) - [*a, 0.0], np.array([*a, 0.0]) - 2 * np.array([*b, 0.0]) + [*c, 0.0]
    d = np.array([*a, 0.0]) - p
    k3 = max(float(bend @ bend), 1e-12)
    k2 = float(start @ bend)
    k1 = 2 * float(start @ start) + d @ bend
    k0 = d @ start
    turn = np.sqrt(np.maximum(k2 * k2 - k3 * k1 / 3, 0))
    left, right = np.clip((-k2 - turn) / k3, 0, 1), np.clip((-k2 + turn) / k3, 0, 1)

    def newton(t: Floats, low: Floats, high: Floats) -> Floats:
        for _ in range(BEZIER_STEPS):
            value = ((k3 * t + 3 * k2) * t + k1) * t + k0
            slope = (3 * k3 * t + 6 * k2) * t + k1
            t = np.clip(t - value / np.maximum(slope, 1e-12), low, high)
        t = t[:, None]
        return length(d + (2 * start + bend * t) * t)

    none, all_ = np.zeros(len(p)), np.ones(len(p))
    return np.minimum(newton(none, none, left), newton(all_, right, all_))


BEZIER_STEPS = 8


def bezier_box(a: Vec2, b: Vec2, c: Vec2) -> tuple[Floats, Floats]:
    """Lower and upper corner (2,) of a quadratic Bézier curve."""
    ends = np.array([a, c])
    start, bend = np.subtract(b, a), np.array(a) - 2 * np.array(b) + c
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.nan_to_num(np.clip(-start / bend, 0, 1))
    turns = np.array(a) + (2 * start + bend * t) * t
    return np.minimum(ends.min(axis=0), turns), np.maximum(ends.max(axis=0), turns)


class Solid(Primitive):
    """A primitive of three dimensions.

    Attributes:
        id: S5's number of it; None for what S5 has no number left for.
    """

    id: ClassVar[int | None] = None
    measured: ClassVar[bool] = True


# --- round ---


@dataclass(frozen=True)
class Sphere(Solid):
    """|p| − r."""

    code: ClassVar[str] = "sphere"
    id: ClassVar[int | None] = 0
    places: ClassVar[tuple[str, ...] | None] = ()
    radius: float = param(1.0, SMALLEST, None, "radius", unit="m")

    def distance(self, p: Floats) -> Floats:
        return length(p) - self.radius

    @property
    def corners(self) -> Box:
        return centred([self.radius] * 3)


@dataclass(frozen=True)
class Ellipsoid(Solid):
    """An ellipsoid; see :func:`ellipsoid_distance`. (The usual formula has gradients up to 5.7; this one never more
    than 1.)"""

    code: ClassVar[str] = "ellipsoid"
    id: ClassVar[int | None] = 7
    radii: Vec3 = param((1.0, 0.7, 0.5), SMALLEST, None, "half axes", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        not_thin(self.radii)

    def distance(self, p: Floats) -> Floats:
        return ellipsoid_distance(p, np.array(self.radii))

    @property
    def corners(self) -> Box:
        return centred(self.radii)

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"


@dataclass(frozen=True)
class Torus(Solid):
    """A ring around Z."""

    code: ClassVar[str] = "torus"
    id: ClassVar[int | None] = 4
    radius: float = param(1.0, SMALLEST, None, "of the ring, to the middle of its tube", unit="m")
    tube: float = param(0.25, SMALLEST, None, "radius of the tube", unit="m")

    def distance(self, p: Floats) -> Floats:
        q = radial(p)
        return np.hypot(q[:, 0] - self.radius, q[:, 1]) - self.tube

    @property
    def corners(self) -> Box:
        return centred([self.radius + self.tube, self.radius + self.tube, self.tube])

    @cached_property
    def accuracy(self) -> Accuracy:
        return "exact" if self.tube <= self.radius else "outside"


@dataclass(frozen=True)
class CappedTorus(Solid):
    """An arc of a ring around Z with round ends, to both sides of +Y."""

    code: ClassVar[str] = "capped_torus"
    id: ClassVar[int | None] = 10
    radius: float = param(1.0, SMALLEST, None, "of the ring, to the middle of its tube", unit="m")
    tube: float = param(0.25, SMALLEST, None, "radius of the tube", unit="m")
    angle: float = param(2.0, 0, math.pi, "from +Y to an end", unit="rad")

    @property
    def numbers(self) -> tuple[float, ...]:
        return self.radius, self.tube, math.sin(self.angle), math.cos(self.angle)

    def distance(self, p: Floats) -> Floats:
        x, y, z = np.abs(p[:, 0]), p[:, 1], p[:, 2]
        s, c = math.sin(self.angle), math.cos(self.angle)
        end = np.sqrt((x - self.radius * s) ** 2 + (y - self.radius * c) ** 2 + z * z)
        ring = np.hypot(np.hypot(x, y) - self.radius, z)
        return np.where(c * x > s * y, end, ring) - self.tube

    @property
    def corners(self) -> Box:
        width = self.radius * math.sin(min(self.angle, math.pi / 2))
        low = np.array([-width, self.radius * math.cos(self.angle), 0.0])
        return low - self.tube, np.array([width, self.radius, 0.0]) + self.tube

    @cached_property
    def accuracy(self) -> Accuracy:
        return "exact" if self.tube <= self.radius * min(1.0, math.sin(self.angle)) else "outside"


@dataclass(frozen=True)
class Link(Solid):
    """A chain's link: a ring around Z, pulled apart along Y."""

    code: ClassVar[str] = "link"
    id: ClassVar[int | None] = 11
    length: float = param(1.0, 0, None, "of its straight parts", unit="m")
    radius: float = param(0.5, SMALLEST, None, "of its ends, to the middle of the tube", unit="m")
    tube: float = param(0.15, SMALLEST, None, "radius of the tube", unit="m")

    def distance(self, p: Floats) -> Floats:
        y = np.maximum(np.abs(p[:, 1]) - 0.5 * self.length, 0)
        return np.hypot(np.hypot(p[:, 0], y) - self.radius, p[:, 2]) - self.tube

    @property
    def corners(self) -> Box:
        wide = self.radius + self.tube
        return centred([wide, wide + 0.5 * self.length, self.tube])

    @cached_property
    def accuracy(self) -> Accuracy:
        return "exact" if self.tube <= self.radius else "outside"


@dataclass(frozen=True)
class Capsule(Solid):
    """All places within a radius of a line between two places."""

    code: ClassVar[str] = "capsule"
    id: ClassVar[int | None] = 5
    places: ClassVar[tuple[str, ...] | None] = ("a", "b")
    a: Vec3 = param((0.0, 0.0, -0.5), doc="one end", unit="m")
    b: Vec3 = param((0.0, 0.0, 0.5), doc="the other end", unit="m")
    radius: float = param(0.25, SMALLEST, None, "radius", unit="m")

    @property
    def numbers(self) -> tuple[float, ...]:
        return (*self.a, self.radius, *self.b)

    def distance(self, p: Floats) -> Floats:
        pa, ba = p - np.array(self.a), np.subtract(self.b, self.a)
        h = np.clip(pa @ ba / max(float(ba @ ba), 1e-20), 0, 1)
        return length(pa - h[:, None] * ba) - self.radius

    @property
    def corners(self) -> Box:
        return around([self.a, self.b], [self.radius, self.radius])


@dataclass(frozen=True)
class RoundCone(Solid):
    """Two balls and what lies between them."""

    code: ClassVar[str] = "round_cone"
    id: ClassVar[int | None] = 14
    places: ClassVar[tuple[str, ...] | None] = ("a", "b")
    a: Vec3 = param((0.0, 0.0, -0.5), doc="middle of one ball", unit="m")
    b: Vec3 = param((0.0, 0.0, 0.5), doc="middle of the other", unit="m")
    radius_a: float = param(0.5, SMALLEST, None, "radius of the ball at a", unit="m")
    radius_b: float = param(0.25, SMALLEST, None, "radius of the ball at b", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if math.dist(self.a, self.b) <= abs(self.radius_a - self.radius_b):
            raise ParameterError("round_cone: one ball holds the other; use a sphere")

    @property
    def numbers(self) -> tuple[float, ...]:
        return (*self.a, self.radius_a, *self.b, self.radius_b)

    def distance(self, p: Floats) -> Floats:
        pa, ba = p - np.array(self.a), np.subtract(self.b, self.a)
        h = float(np.linalg.norm(ba))
        y = pa @ ba / h
        x = length(pa - y[:, None] * ba / h)
        sine = (self.radius_a - self.radius_b) / h
        cosine = math.sqrt(1 - sine * sine)
        k = cosine * y - sine * x
        between: Floats = cosine * x + sine * y - self.radius_a
        top = np.hypot(x, y - h) - self.radius_b
        return np.where(k < 0, np.hypot(x, y) - self.radius_a, np.where(k > cosine * h, top, between))

    @property
    def corners(self) -> Box:
        return around([self.a, self.b], [self.radius_a, self.radius_b])


@dataclass(frozen=True)
class Vesica(Solid):
    """A spindle between two places: an arc turned about its chord."""

    code: ClassVar[str] = "vesica"
    id: ClassVar[int | None] = 28
    places: ClassVar[tuple[str, ...] | None] = ("a", "b")
    a: Vec3 = param((0.0, 0.0, -1.0), doc="one tip", unit="m")
    b: Vec3 = param((0.0, 0.0, 1.0), doc="the other tip", unit="m")
    width: float = param(0.5, SMALLEST, None, "radius in the middle", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if 2 * self.width > math.dist(self.a, self.b):
            raise ParameterError("vesica: wider than long; use a sphere or an ellipsoid")

    @property
    def numbers(self) -> tuple[float, ...]:
        return (*self.a, self.width, *self.b)

    def distance(self, p: Floats) -> Floats:
        axis = np.subtract(self.b, self.a)
        r = 0.5 * float(np.linalg.norm(axis))
        pc, v = p - 0.5 * np.add(self.a, self.b), axis / (2 * r)
        y = pc @ v
        x, y = length(pc - y[:, None] * v), np.abs(y)
        d = 0.5 * (r * r - self.width**2) / self.width
        return np.where(r * x < d * (y - r), np.hypot(x, y - r), np.hypot(x + d, y) - (d + self.width))

    @property
    def corners(self) -> Box:
        # How far it reaches along each axis: to the arc's place in that direction, or to a tip.
        axis = np.subtract(self.b, self.a)
        r = 0.5 * float(np.linalg.norm(axis))
        d = 0.5 * (r * r - self.width**2) / self.width
        along = np.abs(axis) / (2 * r)
        across = np.sqrt(np.maximum(1 - along**2, 0))
        reach = np.where((d + self.width) * along < r, d + self.width - d * across, r * along)
        middle = 0.5 * np.add(self.a, self.b)
        return middle - reach, middle + reach


@dataclass(frozen=True)
class Tube(Solid):
    """All places within a radius of a quadratic Bézier curve in the plane of x and y; :func:`tube` takes any three
    places. See :func:`bezier_distance`."""

    code: ClassVar[str] = "tube"
    id: ClassVar[int | None] = 30
    a: Vec2 = param((-1.0, 0.0), doc="where it begins", unit="m")
    b: Vec2 = param((0.0, 1.0), doc="what it bends towards", unit="m")
    c: Vec2 = param((1.0, 0.0), doc="where it ends", unit="m")
    radius: float = param(0.1, SMALLEST, None, "radius of the tube", unit="m")

    def distance(self, p: Floats) -> Floats:
        return bezier_distance(p, self.a, self.b, self.c) - self.radius

    @property
    def corners(self) -> Box:
        low, high = bezier_box(self.a, self.b, self.c)
        return np.array([*low, 0.0]) - self.radius, np.array([*high, 0.0]) + self.radius

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"  # a tight bend fills itself


# --- cut from balls ---


@dataclass(frozen=True)
class SolidAngle(Solid):
    """What of a ball is within an angle of +Z."""

    code: ClassVar[str] = "solid_angle"
    id: ClassVar[int | None] = 15
    angle: float = param(0.8, 0.01, math.pi - 0.01, "between +Z and its side", unit="rad")
    radius: float = param(1.0, SMALLEST, None, "of the ball", unit="m")

    @property
    def numbers(self) -> tuple[float, ...]:
        return math.sin(self.angle), math.cos(self.angle), self.radius

    def distance(self, p: Floats) -> Floats:
        q, c = radial(p), np.array([math.sin(self.angle), math.cos(self.angle)])
        return sector(q, c, self.radius)

    @property
    def corners(self) -> Box:
        wide = self.radius * math.sin(min(self.angle, math.pi / 2))
        low = min(0.0, self.radius * math.cos(self.angle))
        return np.array([-wide, -wide, low]), np.array([wide, wide, self.radius])


def sector(q: Floats, c: Floats, radius: float) -> Floats:
    """A disc's sector to both sides of +Y, in (|x|, y); c is (sine, cosine) of half its angle."""
    edge = length(q - np.clip(q @ c, 0, radius)[:, None] * c)
    return np.maximum(length(q) - radius, np.where(c[1] * q[:, 0] > c[0] * q[:, 1], edge, -edge))


@dataclass(frozen=True)
class CutSphere(Solid):
    """What of a ball is above a height."""

    code: ClassVar[str] = "cut_sphere"
    id: ClassVar[int | None] = 16
    radius: float = param(1.0, SMALLEST, None, "of the ball", unit="m")
    height: float = param(0.0, doc="of the cut, −radius … radius", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if abs(self.height) >= self.radius:
            raise ParameterError("cut_sphere: the cut at this height misses the ball")

    def distance(self, p: Floats) -> Floats:
        return cap(radial(p), self.radius, self.height)

    @property
    def corners(self) -> Box:
        wide = self.radius if self.height <= 0 else math.sqrt(self.radius**2 - self.height**2)
        return np.array([-wide, -wide, self.height]), np.array([wide, wide, self.radius])


def cap(q: Floats, r: float, h: float) -> Floats:
    """What of a disc is above y = h, in (|x|, y)."""
    w = math.sqrt(r * r - h * h)
    x, y = q[:, 0], q[:, 1]
    s = np.maximum((h - r) * x * x + w * w * (h + r - 2 * y), h * x - w * y)
    return np.where(s < 0, np.hypot(x, y) - r, np.where(x < w, h - y, np.hypot(x - w, y - h)))


@dataclass(frozen=True)
class CutHollowSphere(Solid):
    """A bowl: what of a sphere is below a height, as a sheet with a round rim."""

    code: ClassVar[str] = "cut_hollow_sphere"
    id: ClassVar[int | None] = 17
    radius: float = param(1.0, SMALLEST, None, "of the middle of the sheet", unit="m")
    height: float = param(0.0, doc="of the rim, −radius … radius", unit="m")
    thickness: float = param(0.1, SMALLEST, None, "of the sheet", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if abs(self.height) >= self.radius:
            raise ParameterError("cut_hollow_sphere: the cut at this height misses the ball")

    def distance(self, p: Floats) -> Floats:
        q, r, h = radial(p), self.radius, self.height
        w = math.sqrt(r * r - h * h)
        x, y = q[:, 0], q[:, 1]
        rim, sheet = np.hypot(x - w, y - h), np.abs(np.hypot(x, y) - r)
        return np.where(h * x < w * y, rim, sheet) - 0.5 * self.thickness

    @property
    def corners(self) -> Box:
        wide = self.radius if self.height >= 0 else math.sqrt(self.radius**2 - self.height**2)
        t = 0.5 * self.thickness
        return np.array([-wide, -wide, -self.radius]) - t, np.array([wide, wide, self.height]) + t

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"


@dataclass(frozen=True)
class DeathStar(Solid):
    """A ball without another whose middle lies on +Z."""

    code: ClassVar[str] = "death_star"
    id: ClassVar[int | None] = 18
    radius: float = param(1.0, SMALLEST, None, "of the ball", unit="m")
    bite: float = param(0.8, SMALLEST, None, "radius of what is taken away", unit="m")
    away: float = param(1.2, SMALLEST, None, "of its middle from the ball's", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if not abs(self.radius - self.bite) < self.away < self.radius + self.bite:
            raise ParameterError("death_star: the two balls' surfaces do not meet")

    def distance(self, p: Floats) -> Floats:
        return bitten(radial(p), self.radius, self.bite, self.away)

    @property
    def corners(self) -> Box:
        low, high = bitten_box(self.radius, self.bite, self.away)
        return np.array([-high[0], -high[0], low[1]]), np.array([high[0], high[0], high[1]])

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"


def bitten(q: Floats, ra: float, rb: float, d: float) -> Floats:
    """A disc without another whose middle is (0, d), in (|x|, y)."""
    a = (ra * ra - rb * rb + d * d) / (2 * d)
    b = math.sqrt(max(ra * ra - a * a, 0))
    x, y = q[:, 0], q[:, 1]
    both = np.maximum(np.hypot(x, y) - ra, rb - np.hypot(x, y - d))
    return np.where(y * b - x * a > d * np.maximum(b - x, 0), np.hypot(x - b, y - a), both)


def bitten_box(ra: float, rb: float, d: float) -> tuple[Vec2, Vec2]:
    """Its corners. What is left of the disc's widest line is all below the edge of the bite, where that is above 0."""
    a = (ra * ra - rb * rb + d * d) / (2 * d)
    wide = ra if a >= 0 else math.sqrt(ra * ra - a * a)
    return (-wide, -ra), (wide, a)


# --- with edges ---


@dataclass(frozen=True)
class Cuboid(Solid):
    """A box around 0."""

    code: ClassVar[str] = "cuboid"
    id: ClassVar[int | None] = 1
    size: Vec3 = param((1.0, 1.0, 1.0), SMALLEST, None, "whole sides", unit="m")

    def distance(self, p: Floats) -> Floats:
        return box_distance(np.abs(p) - 0.5 * np.array(self.size))

    @property
    def corners(self) -> Box:
        return centred(0.5 * np.array(self.size))


def box_distance(q: Floats) -> Floats:
    """Of places that are q beyond a box's sides."""
    return length(np.maximum(q, 0)) + np.minimum(q.max(axis=1), 0)


@dataclass(frozen=True)
class RoundedBox(Solid):
    """A box around 0 with round edges, which do not add to its sides."""

    code: ClassVar[str] = "rounded_box"
    id: ClassVar[int | None] = 8
    size: Vec3 = param((1.0, 1.0, 1.0), SMALLEST, None, "whole sides", unit="m")
    radius: float = param(0.1, 0, None, "of the edges", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if 2 * self.radius > min(self.size):
            raise ParameterError(f"radius: {self.radius:g} is more than half the shortest side")

    def distance(self, p: Floats) -> Floats:
        return box_distance(np.abs(p) - 0.5 * np.array(self.size) + self.radius) - self.radius

    @property
    def corners(self) -> Box:
        return centred(0.5 * np.array(self.size))


@dataclass(frozen=True)
class BoxFrame(Solid):
    """The twelve edges of a box around 0 as bars."""

    code: ClassVar[str] = "box_frame"
    id: ClassVar[int | None] = 9
    size: Vec3 = param((1.0, 1.0, 1.0), SMALLEST, None, "whole sides", unit="m")
    edge: float = param(0.1, SMALLEST, None, "thickness of a bar", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if 2 * self.edge > min(self.size):
            raise ParameterError(f"edge: {self.edge:g} is more than half the shortest side")

    def distance(self, p: Floats) -> Floats:
        e = 0.5 * self.edge
        p = np.abs(p) - 0.5 * np.array(self.size)
        q = np.abs(p + e) - e
        bars = [box_distance(np.where(np.arange(3) == axis, p, q)) for axis in range(3)]
        return np.min(bars, axis=0)

    @property
    def corners(self) -> Box:
        return centred(0.5 * np.array(self.size))

    @cached_property
    def accuracy(self) -> Accuracy:
        return "outside"


@dataclass(frozen=True)
class Plane(Solid):
    """All that is below a plane."""

    code: ClassVar[str] = "plane"
    id: ClassVar[int | None] = 3
    normal: Vec3 = param((0.0, 1.0, 0.0), doc="out of what is solid; any length")
    offset: float = param(0.0, doc="of the plane from 0 along the normal", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if not any(self.normal):
            raise ParameterError("normal: (0, 0, 0) is no direction")

    @property
    def unit(self) -> Floats:
        """The normal with length 1."""
        n: Floats = np.array(self.normal) / np.linalg.norm(self.normal)
        return n

    @property
    def numbers(self) -> tuple[float, ...]:
        return (*(float(x) for x in self.unit), self.offset)

    def distance(self, p: Floats) -> Floats:
        return p @ self.unit - self.offset

    @property
    def corners(self) -> Box:
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        n = self.unit
        along = np.flatnonzero(np.abs(n) == 1)
        for axis in along:
            side = high if n[axis] > 0 else low
            side[axis] = self.offset * n[axis]
        return low, high


@dataclass(frozen=True)
class Wedge(Solid):
    """Half of a box around 0: below the diagonal that falls from −X to +X, as wide along Z."""

    code: ClassVar[str] = "wedge"
    id: ClassVar[int | None] = 29
    size: Vec3 = param((1.0, 1.0, 1.0), SMALLEST, None, "whole sides of the box", unit="m")

    def distance(self, p: Floats) -> Floats:
        x, y, z = (0.5 * s for s in self.size)
        d = triangle_distance(p[:, :2], (-x, -y), (x, -y), (-x, y))
        return prism(d, np.abs(p[:, 2]) - z)

    @property
    def corners(self) -> Box:
        return centred(0.5 * np.array(self.size))


def triangle_distance(p: Floats, a: Vec2, b: Vec2, c: Vec2) -> Floats:
    """A triangle in the plane, its corners in either order."""
    corners = np.array([a, b, c])
    e, v = np.roll(corners, -1, axis=0) - corners, p[:, None] - corners
    h = np.clip((v * e).sum(axis=2) / (e * e).sum(axis=1), 0, 1)
    nearest = length(v - e * h[..., None]).min(axis=1)
    turn = math.copysign(1, e[0, 0] * e[1, 1] - e[0, 1] * e[1, 0])
    inside = (turn * (e[:, 0] * v[..., 1] - e[:, 1] * v[..., 0]) >= 0).all(axis=1)
    return np.where(inside, -nearest, nearest)


@dataclass(frozen=True)
class HexagonalPrism(Solid):
    """A prism along Z over a hexagon with corners on ±X."""

    code: ClassVar[str] = "hexagonal_prism"
    id: ClassVar[int | None] = 25
    radius: float = param(1.0, SMALLEST, None, "of the circle through the corners", unit="m")
    height: float = param(1.0, SMALLEST, None, "along Z", unit="m")

    def distance(self, p: Floats) -> Floats:
        q = mirrored(np.abs(p[:, :2]), (-0.5 * math.sqrt(3), 0.5))
        return prism(side(q, 0.5 * math.sqrt(3) * self.radius, 0.5 * self.radius), np.abs(p[:, 2]) - 0.5 * self.height)

    @property
    def corners(self) -> Box:
        return centred([self.radius, 0.5 * math.sqrt(3) * self.radius, 0.5 * self.height])


@dataclass(frozen=True)
class TriangularPrism(Solid):
    """A prism along Z over an equilateral triangle with a corner on +Y."""

    code: ClassVar[str] = "triangular_prism"
    id: ClassVar[int | None] = 26
    radius: float = param(1.0, SMALLEST, None, "of the circle through the corners", unit="m")
    height: float = param(1.0, SMALLEST, None, "along Z", unit="m")

    def distance(self, p: Floats) -> Floats:
        q = mirrored(np.stack([np.abs(p[:, 0]), -p[:, 1]], axis=1), (-0.5, 0.5 * math.sqrt(3)))
        return prism(side(q, 0.5 * self.radius, 0.5 * math.sqrt(3) * self.radius), np.abs(p[:, 2]) - 0.5 * self.height)

    @property
    def corners(self) -> Box:
        wide, tall = 0.5 * math.sqrt(3) * self.radius, 0.5 * self.height
        return np.array([-wide, -0.5 * self.radius, -tall]), np.array([wide, self.radius, tall])


@dataclass(frozen=True)
class OctagonalPrism(Solid):
    """A prism along Z over an octagon with sides across ±X and ±Y."""

    code: ClassVar[str] = "octagonal_prism"
    id: ClassVar[int | None] = 27
    radius: float = param(1.0, SMALLEST, None, "of the circle through the corners", unit="m")
    height: float = param(1.0, SMALLEST, None, "along Z", unit="m")

    def distance(self, p: Floats) -> Floats:
        s, c = math.sin(math.pi / 8), math.cos(math.pi / 8)
        q = mirrored(np.sort(np.abs(p[:, :2]), axis=1), (-c, s))
        return prism(side(q, c * self.radius, s * self.radius), np.abs(p[:, 2]) - 0.5 * self.height)

    @property
    def corners(self) -> Box:
        c = math.cos(math.pi / 8)
        return centred([c * self.radius, c * self.radius, 0.5 * self.height])


@dataclass(frozen=True)
class RhombicPrism(Solid):
    """A prism along Z over a rhombus."""

    code: ClassVar[str] = "rhombic_prism"
    id: ClassVar[int | None] = 24
    size: Vec2 = param((2.0, 1.0), SMALLEST, None, "whole diagonals, along X and Y", unit="m")
    height: float = param(0.5, SMALLEST, None, "along Z", unit="m")

    def distance(self, p: Floats) -> Floats:
        return prism(rhombus_distance(p, self.size), np.abs(p[:, 2]) - 0.5 * self.height)

    @property
    def corners(self) -> Box:
        return centred([0.5 * self.size[0], 0.5 * self.size[1], 0.5 * self.height])


def rhombus_distance(p: Floats, size: Vec2) -> Floats:
    """A rhombus by its whole diagonals."""
    tip, e = np.array([0.5 * size[0], 0.0]), np.array([-0.5 * size[0], 0.5 * size[1]])
    w = np.abs(p[:, :2]) - tip
    h = np.clip(w @ e / (e @ e), 0, 1)
    d = length(w - h[:, None] * e)
    return np.where(e[0] * w[:, 1] - e[1] * w[:, 0] < 0, d, -d)


# --- polyhedra ---


@dataclass(frozen=True)
class Octahedron(Solid):
    """A regular octahedron with its corners on the axes."""

    code: ClassVar[str] = "octahedron"
    id: ClassVar[int | None] = 19
    radius: float = param(1.0, SMALLEST, None, "from the middle to a corner", unit="m")

    def distance(self, p: Floats) -> Floats:
        q = -np.sort(-np.abs(p), axis=1)
        s2, s3, s6, r = math.sqrt(2), math.sqrt(3), math.sqrt(6), self.radius
        return face(q, (1 / s3,) * 3, (1 / s6, 1 / s6, -2 / s6), (1 / s2, -1 / s2, 0.0), r / s3, r / s6, r / s2)

    @property
    def corners(self) -> Box:
        return centred([self.radius] * 3)


@dataclass(frozen=True)
class Tetrahedron(Solid):
    """A regular tetrahedron; its corners lie along (1, 1, 1), (1, −1, −1), (−1, 1, −1) and (−1, −1, 1)."""

    code: ClassVar[str] = "tetrahedron"
    id: ClassVar[int | None] = 21
    radius: float = param(1.0, SMALLEST, None, "from the middle to a corner", unit="m")

    def distance(self, p: Floats) -> Floats:
        q = -np.sort(-np.abs(p), axis=1)
        q[:, 2] = np.where(p.prod(axis=1) < 0, -q[:, 2], q[:, 2])
        s2, s3, s6, r = math.sqrt(2), math.sqrt(3), math.sqrt(6), self.radius
        n, out, along = (1 / s3, 1 / s3, -1 / s3), (2 / s6, -1 / s6, 1 / s6), (0.0, 1 / s2, 1 / s2)
        return face(q, n, out, along, r / 3, r * s2 / 3, r * s2 / s3)

    @property
    def corners(self) -> Box:
        return centred([self.radius / math.sqrt(3)] * 3)


_COSINE = math.cos(math.pi / 5)
_MIRROR = (-0.5, -_COSINE, math.sqrt(0.75 - _COSINE**2))  # with those of x and y: the icosahedral group
_FIVE = np.array([_MIRROR[2], 0, 0.5]) / math.hypot(_MIRROR[2], 0.5)  # axes of its five- and threefold turns
_THREE = np.array([0, _MIRROR[2], _COSINE]) / math.hypot(_MIRROR[2], _COSINE)


def icosahedral(p: Floats) -> Floats:
    """Folded into the chamber of x ≥ 0, y ≥ 0 and the third mirror; 15 reflections reach every chamber."""
    for _ in range(5):
        p = mirrored(np.abs(p) * [1, 1, 0] + p * [0, 0, 1], _MIRROR)
    return p


def _regular(corner: Floats, normal: Floats) -> tuple[Vec3, float, float, float]:
    """Of a polyhedron of radius 1 about these axes: the way out over an edge, and the face's height, apothem and
    half an edge."""
    height = float(corner @ normal)
    out = np.array([0, 0, corner[2]]) - height * normal
    apothem = float(np.linalg.norm(out))
    x, y, z = (float(v) for v in out / apothem)
    return (x, y, z), height, apothem, float(math.hypot(corner[0], corner[1]))


@dataclass(frozen=True)
class Dodecahedron(Solid):
    """A regular dodecahedron with edges across the axes."""

    code: ClassVar[str] = "dodecahedron"
    id: ClassVar[int | None] = 22
    radius: float = param(1.0, SMALLEST, None, "from the middle to a corner", unit="m")

    def distance(self, p: Floats) -> Floats:
        out, h, a, half = _regular(_THREE, _FIVE)
        r = self.radius
        return face(icosahedral(p), tuple(_FIVE), out, (0.0, 1.0, 0.0), h * r, a * r, half * r)

    @property
    def corners(self) -> Box:
        return centred([float(_THREE[2]) * self.radius] * 3)


@dataclass(frozen=True)
class Icosahedron(Solid):
    """A regular icosahedron with edges across the axes."""

    code: ClassVar[str] = "icosahedron"
    id: ClassVar[int | None] = 23
    radius: float = param(1.0, SMALLEST, None, "from the middle to a corner", unit="m")

    def distance(self, p: Floats) -> Floats:
        out, h, a, half = _regular(_FIVE, _THREE)
        r = self.radius
        return face(icosahedral(p), tuple(_THREE), out, (1.0, 0.0, 0.0), h * r, a * r, half * r)

    @property
    def corners(self) -> Box:
        return centred([float(_FIVE[2]) * self.radius] * 3)


@dataclass(frozen=True)
class Pyramid(Solid):
    """A pyramid on a square in the plane of x and y, its tip on +Z."""

    code: ClassVar[str] = "pyramid"
    id: ClassVar[int | None] = 20
    base: float = param(1.0, SMALLEST, None, "side of the square", unit="m")
    height: float = param(1.0, SMALLEST, None, "of the tip above it", unit="m")

    def distance(self, p: Floats) -> Floats:
        b, h = 0.5 * self.base, self.height
        q = np.abs(p[:, :2])
        x, y, z = q.max(axis=1) - b, q.min(axis=1) - b, p[:, 2]  # from the corner of the base
        slope = math.hypot(h, b)
        away, up = (x * h + z * b) / slope, (z * h - x * b) / slope  # off a side, and from its foot to the tip
        t = np.clip((up * slope - y * b) / (slope * slope + b * b), 0, 1)
        edge = np.sqrt(away**2 + (up - t * slope) ** 2 + (y + t * b) ** 2)
        foot = np.sqrt(away**2 + np.minimum(up, 0) ** 2 + np.maximum(y, 0) ** 2)
        wall = np.where(slope * y + b * up > 0, edge, foot)
        floor = np.sqrt(np.maximum(x, 0) ** 2 + np.maximum(y, 0) ** 2 + z * z)
        inside = np.maximum(away, -z)
        return np.where(inside < 0, inside, np.minimum(wall, floor))

    @property
    def corners(self) -> Box:
        b = 0.5 * self.base
        return np.array([-b, -b, 0]), np.array([b, b, self.height])


# --- cylinders and cones ---


@dataclass(frozen=True)
class Cylinder(Solid):
    """A cylinder along Z with flat ends."""

    code: ClassVar[str] = "cylinder"
    id: ClassVar[int | None] = 2
    radius: float = param(1.0, SMALLEST, None, "radius", unit="m")
    height: float = param(1.0, SMALLEST, None, "along Z", unit="m")

    def distance(self, p: Floats) -> Floats:
        q = radial(p)
        return prism(q[:, 0] - self.radius, np.abs(q[:, 1]) - 0.5 * self.height)

    @property
    def corners(self) -> Box:
        return centred([self.radius, self.radius, 0.5 * self.height])


@dataclass(frozen=True)
class RoundedCylinder(Solid):
    """A cylinder along Z with round edges, which do not add to it."""

    code: ClassVar[str] = "rounded_cylinder"
    radius: float = param(1.0, SMALLEST, None, "radius", unit="m")
    height: float = param(1.0, SMALLEST, None, "along Z", unit="m")
    edge: float = param(0.1, 0, None, "radius of the edges", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if self.edge > min(self.radius, 0.5 * self.height):
            raise ParameterError(f"edge: {self.edge:g} is more than the radius or half the height")

    def distance(self, p: Floats) -> Floats:
        q = radial(p)
        d, beyond = q[:, 0] - self.radius + self.edge, np.abs(q[:, 1]) - 0.5 * self.height + self.edge
        return prism(d, beyond) - self.edge

    @property
    def corners(self) -> Box:
        return centred([self.radius, self.radius, 0.5 * self.height])


@dataclass(frozen=True)
class InfiniteCylinder(Solid):
    """A cylinder along Z without ends."""

    code: ClassVar[str] = "infinite_cylinder"
    id: ClassVar[int | None] = 12
    radius: float = param(1.0, SMALLEST, None, "radius", unit="m")

    def distance(self, p: Floats) -> Floats:
        return np.hypot(p[:, 0], p[:, 1]) - self.radius

    @property
    def corners(self) -> Box:
        return centred([self.radius, self.radius, np.inf])


@dataclass(frozen=True)
class Cone(Solid):
    """A cone along Z with flat ends, one of which may be a tip."""

    code: ClassVar[str] = "cone"
    id: ClassVar[int | None] = 6
    radius: float = param(1.0, 0, None, "at −height/2", unit="m")
    height: float = param(1.0, SMALLEST, None, "along Z", unit="m")
    top: float = param(0.0, 0, None, "radius at +height/2", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if self.radius + self.top < SMALLEST:
            raise ParameterError("cone: both radii are 0")

    def distance(self, p: Floats) -> Floats:
        q = radial(p)
        return cone_distance(q[:, 0], q[:, 1] + 0.5 * self.height, self.height, self.radius, self.top)

    @property
    def corners(self) -> Box:
        wide = max(self.radius, self.top)
        return centred([wide, wide, 0.5 * self.height])


def cone_distance(x: Floats, y: Floats, h: float, r1: float, r2: float) -> Floats:
    """A cone with flat ends from (·, 0) to (·, h), in (radius, height)."""
    ax, ay = np.maximum(x - np.where(y < 0.5 * h, r1, r2), 0), np.abs(y - 0.5 * h) - 0.5 * h
    k = r2 - r1
    t = np.clip((k * (x - r1) + y * h) / (k * k + h * h), 0, 1)
    bx, by = x - r1 - t * k, y - t * h
    d = np.minimum(np.hypot(ax, ay), np.hypot(bx, by))
    return np.where((bx < 0) & (ay < 0), -d, d)


@dataclass(frozen=True)
class CappedCone(Solid):
    """A cone with flat ends between two places."""

    code: ClassVar[str] = "capped_cone"
    places: ClassVar[tuple[str, ...] | None] = ("a", "b")
    a: Vec3 = param((0.0, 0.0, -0.5), doc="middle of one end", unit="m")
    b: Vec3 = param((0.0, 0.0, 0.5), doc="middle of the other", unit="m")
    radius_a: float = param(0.5, 0, None, "radius at a", unit="m")
    radius_b: float = param(0.25, 0, None, "radius at b", unit="m")

    def __post_init__(self) -> None:
        Primitive.__post_init__(self)
        if math.dist(self.a, self.b) < SMALLEST or self.radius_a + self.radius_b < SMALLEST:
            raise ParameterError("capped_cone: no length, or both radii are 0")

    @property
    def numbers(self) -> tuple[float, ...]:
        return (*self.a, self.radius_a, *self.b, self.radius_b)

    def distance(self, p: Floats) -> Floats:
        pa, ba = p - np.array(self.a), np.subtract(self.b, self.a)
        h = float(np.linalg.norm(ba))
        y = pa @ ba / h
        return cone_distance(length(pa - y[:, None] * ba / h), y, h, self.radius_a, self.radius_b)

    @property
    def corners(self) -> Box:
        a, b = np.array(self.a), np.array(self.b)
        flat = np.sqrt(np.maximum(1 - ((b - a) / np.linalg.norm(b - a)) ** 2, 0))
        low = np.minimum(a - self.radius_a * flat, b - self.radius_b * flat)
        return low, np.maximum(a + self.radius_a * flat, b + self.radius_b * flat)


@dataclass(frozen=True)
class InfiniteCone(Solid):
    """A cone without end from its tip at 0 along +Z."""

    code: ClassVar[str] = "infinite_cone"
    id: ClassVar[int | None] = 13
    angle: float = param(0.5, 0.01, math.pi / 2, "between +Z and its side", unit="rad")

    @property
    def numbers(self) -> tuple[float, ...]:
        return math.sin(self.angle), math.cos(self.angle)

    def distance(self, p: Floats) -> Floats:
        q, c = radial(p), np.array([math.sin(self.angle), math.cos(self.angle)])
        d = length(q - np.maximum(q @ c, 0)[:, None] * c)
        return np.where(q[:, 0] * c[1] < q[:, 1] * c[0], -d, d)

    @property
    def corners(self) -> Box:
        return np.array([-np.inf, -np.inf, 0]), np.full(3, np.inf)


@dataclass(frozen=True)
class Gyroid(Solid):
    """A sheet along Schoen's gyroid, without end: |sin x cos z + sin y cos x + sin z cos y| / √3 of places × 2π/period.

    A derivative is at most √(cos² z + sin² y), and these squares add up to 3, so the gradient is never more than √3.
    The sheet is about as thick as said where the gradient is greatest, and up to √3 times that elsewhere.
    """

    code: ClassVar[str] = "gyroid"
    id: ClassVar[int | None] = 31
    period: float = param(1.0, SMALLEST, None, "after which it repeats", unit="m")
    thickness: float = param(0.05, SMALLEST, None, "of the sheet", unit="m")

    def distance(self, p: Floats) -> Floats:
        k = 2 * math.pi / self.period
        s, c = np.sin(k * p), np.cos(k * p)
        g = (s * np.roll(c, 1, axis=1)).sum(axis=1)
        return np.abs(g) / (k * math.sqrt(3)) - 0.5 * self.thickness

    @property
    def corners(self) -> Box:
        return centred([np.inf] * 3)

    @cached_property
    def accuracy(self) -> Accuracy:
        return "bound"


_ALL: tuple[type[Solid], ...] = (
    Sphere, Cuboid, Cylinder, Plane, Torus, Capsule, Cone, Ellipsoid, RoundedBox, BoxFrame, CappedTorus, Link,
    InfiniteCylinder, InfiniteCone, RoundCone, SolidAngle, CutSphere, CutHollowSphere, DeathStar, Octahedron, Pyramid,
    Tetrahedron, Dodecahedron, Icosahedron, RhombicPrism, HexagonalPrism, TriangularPrism, OctagonalPrism, Vesica,
    Wedge, Tube, Gyroid, RoundedCylinder, CappedCone,
)  # fmt: skip
SOLIDS: dict[str, type[Solid]] = {cls.code: cls for cls in _ALL}


# --- as they are written ---


def sphere(radius: float = 1.0) -> Sphere:
    """A sphere around 0; see :class:`Sphere`."""
    return Sphere(radius)


def ellipsoid(radii: Vec3 = (1.0, 0.7, 0.5)) -> Ellipsoid:
    """An ellipsoid around 0 with half axes along X, Y and Z; see :class:`Ellipsoid`."""
    return Ellipsoid(radii)


def box(size: float | Vec3 = 1.0) -> Cuboid:
    """A box around 0 with whole sides ``size``, or a cube; see :class:`Cuboid`."""
    return Cuboid(_sides(size))


def rounded_box(size: float | Vec3 = 1.0, radius: float = 0.1) -> RoundedBox:
    """A box with round edges; see :class:`RoundedBox`."""
    return RoundedBox(_sides(size), radius)


def box_frame(size: float | Vec3 = 1.0, edge: float = 0.1) -> BoxFrame:
    """The edges of a box; see :class:`BoxFrame`."""
    return BoxFrame(_sides(size), edge)


def wedge(size: float | Vec3 = 1.0) -> Wedge:
    """Half of a box; see :class:`Wedge`."""
    return Wedge(_sides(size))


def plane(normal: Vec3 = (0.0, 1.0, 0.0), offset: float = 0.0) -> Plane:
    """All below a plane; see :class:`Plane`."""
    return Plane(normal, offset)


def torus(radius: float = 1.0, tube: float = 0.25) -> Torus:
    """A ring around Z; see :class:`Torus`."""
    return Torus(radius, tube)


def capped_torus(radius: float = 1.0, tube: float = 0.25, angle: float = 2.0) -> CappedTorus:
    """An arc of a ring; see :class:`CappedTorus`."""
    return CappedTorus(radius, tube, angle)


def link(length: float = 1.0, radius: float = 0.5, tube: float = 0.15) -> Link:
    """A chain's link; see :class:`Link`."""
    return Link(length, radius, tube)


def capsule(a: Vec3 = (0.0, 0.0, -0.5), b: Vec3 = (0.0, 0.0, 0.5), radius: float = 0.25) -> Capsule:
    """A thick line; see :class:`Capsule`."""
    return Capsule(a, b, radius)


def round_cone(
    a: Vec3 = (0.0, 0.0, -0.5), b: Vec3 = (0.0, 0.0, 0.5), radius_a: float = 0.5, radius_b: float = 0.25
) -> RoundCone:
    """Two balls and what lies between; see :class:`RoundCone`."""
    return RoundCone(a, b, radius_a, radius_b)


def vesica(a: Vec3 = (0.0, 0.0, -1.0), b: Vec3 = (0.0, 0.0, 1.0), width: float = 0.5) -> Vesica:
    """A spindle; see :class:`Vesica`."""
    return Vesica(a, b, width)


def tube(a: Vec3, b: Vec3, c: Vec3, radius: float = 0.1) -> Shape:
    """A tube along a quadratic Bézier curve from a to c that bends towards b, anywhere; see :class:`Tube`."""
    middle, start = np.array(a, np.float64), np.subtract(b, a).astype(np.float64)
    over = np.subtract(c, a).astype(np.float64)
    if not (np.isfinite(start).all() and np.isfinite(over).all()) or not over.any():
        raise ParameterError("tube: its ends are one place")
    x = over / np.linalg.norm(over)
    y = start - (start @ x) * x
    if np.linalg.norm(y) < 1e-9 * np.linalg.norm(over):
        y = np.cross(x, np.eye(3)[np.abs(x).argmin()])  # all in a line: any plane holds it
    y = y / np.linalg.norm(y)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, y, np.cross(x, y), middle
    flat = Tube((0.0, 0.0), (float(start @ x), float(start @ y)), (float(over @ x), 0.0), radius)
    return Transformed(flat, tuple(tuple(float(v) for v in row) for row in matrix))


def solid_angle(angle: float = 0.8, radius: float = 1.0) -> SolidAngle:
    """A ball's sector; see :class:`SolidAngle`."""
    return SolidAngle(angle, radius)


def cut_sphere(radius: float = 1.0, height: float = 0.0) -> CutSphere:
    """A ball above a height; see :class:`CutSphere`."""
    return CutSphere(radius, height)


def cut_hollow_sphere(radius: float = 1.0, height: float = 0.0, thickness: float = 0.1) -> CutHollowSphere:
    """A bowl; see :class:`CutHollowSphere`."""
    return CutHollowSphere(radius, height, thickness)


def death_star(radius: float = 1.0, bite: float = 0.8, away: float = 1.2) -> DeathStar:
    """A ball with a bite taken out; see :class:`DeathStar`."""
    return DeathStar(radius, bite, away)


def cylinder(radius: float = 1.0, height: float | None = None) -> Cylinder | InfiniteCylinder:
    """A cylinder along Z, without ends where no height is given; see :class:`Cylinder`."""
    return InfiniteCylinder(radius) if height is None else Cylinder(radius, height)


def rounded_cylinder(radius: float = 1.0, height: float = 1.0, edge: float = 0.1) -> RoundedCylinder:
    """A cylinder with round edges; see :class:`RoundedCylinder`."""
    return RoundedCylinder(radius, height, edge)


def cone(radius: float = 1.0, height: float = 1.0, top: float = 0.0) -> Cone:
    """A cone along Z; see :class:`Cone`."""
    return Cone(radius, height, top)


def capped_cone(
    a: Vec3 = (0.0, 0.0, -0.5), b: Vec3 = (0.0, 0.0, 0.5), radius_a: float = 0.5, radius_b: float = 0.25
) -> CappedCone:
    """A cone with flat ends between two places; see :class:`CappedCone`."""
    return CappedCone(a, b, radius_a, radius_b)


def infinite_cone(angle: float = 0.5) -> InfiniteCone:
    """A cone without end; see :class:`InfiniteCone`."""
    return InfiniteCone(angle)


def hexagonal_prism(radius: float = 1.0, height: float = 1.0) -> HexagonalPrism:
    """See :class:`HexagonalPrism`."""
    return HexagonalPrism(radius, height)


def triangular_prism(radius: float = 1.0, height: float = 1.0) -> TriangularPrism:
    """See :class:`TriangularPrism`."""
    return TriangularPrism(radius, height)


def octagonal_prism(radius: float = 1.0, height: float = 1.0) -> OctagonalPrism:
    """See :class:`OctagonalPrism`."""
    return OctagonalPrism(radius, height)


def rhombic_prism(size: Vec2 = (2.0, 1.0), height: float = 0.5) -> RhombicPrism:
    """See :class:`RhombicPrism`."""
    return RhombicPrism(size, height)


def octahedron(radius: float = 1.0) -> Octahedron:
    """See :class:`Octahedron`."""
    return Octahedron(radius)


def pyramid(base: float = 1.0, height: float = 1.0) -> Pyramid:
    """See :class:`Pyramid`."""
    return Pyramid(base, height)


def tetrahedron(radius: float = 1.0) -> Tetrahedron:
    """See :class:`Tetrahedron`."""
    return Tetrahedron(radius)


def dodecahedron(radius: float = 1.0) -> Dodecahedron:
    """See :class:`Dodecahedron`."""
    return Dodecahedron(radius)


def icosahedron(radius: float = 1.0) -> Icosahedron:
    """See :class:`Icosahedron`."""
    return Icosahedron(radius)


def gyroid(period: float = 1.0, thickness: float = 0.05) -> Gyroid:
    """A sheet without end; see :class:`Gyroid`."""
    return Gyroid(period, thickness)


def _sides(size: float | Vec3) -> Vec3:
    return (size, size, size) if isinstance(size, (int, float)) else size
