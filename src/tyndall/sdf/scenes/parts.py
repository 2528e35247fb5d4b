"""What the bundled implicit scenes are put together from: colours, balls, limbs between two points, curves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.scene.model import Mat4, Material, Vec3
from tyndall.sdf.shape import Floats, Shape
from tyndall.sdf.solids import ellipsoid, round_cone, sphere

Place = Sequence[float] | Floats


def paint(color: str, roughness: float = 0.8, metallic: float = 0.0, glow: float = 0.0) -> Material:
    """A material of an sRGB colour ``#rrggbb``; ``glow`` is the radiance that it emits in its own colour."""
    encoded = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    r, g, b = (float(x) for x in np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4))
    return Material(color, (r, g, b, 1.0), metallic, roughness, (glow * r, glow * g, glow * b))


def ball(place: Place, radius: float) -> Shape:
    """A sphere at a place."""
    return sphere(radius).at(*place)


def egg(place: Place, radii: Vec3, turn: ArrayLike | None = None) -> Shape:
    """An ellipsoid at a place, turned before by a 4×4 rotation."""
    shape: Shape = ellipsoid(radii)
    if turn is not None:
        shape = shape.transform(turn)
    return shape.at(*place)


def limb(start: ArrayLike, end: ArrayLike, radius: float, end_radius: float | None = None) -> Shape:
    """Two balls and the cone that touches both; one ball where the other is within it."""
    a, b = np.asarray(start, np.float64), np.asarray(end, np.float64)
    last = radius if end_radius is None else end_radius
    length = float(np.linalg.norm(b - a))
    if length <= abs(radius - last) + 1e-6:
        return ball(a, radius) if radius >= last else ball(b, last)
    return round_cone(_triple(a), _triple(b), radius, last)


def _triple(v: Floats) -> Vec3:
    return (float(v[0]), float(v[1]), float(v[2]))


def curve(points: ArrayLike | Sequence[Place], count: int) -> NDArray[np.float64]:
    """(count, D) places on a curve through (N, D) points, evenly in its parameter (Catmull and Rom 1974)."""
    p = np.asarray(points, np.float64)
    p = np.concatenate([[2 * p[0] - p[1]], p, [2 * p[-1] - p[-2]]])
    t = np.linspace(0, len(p) - 3, count)
    i = np.minimum(t.astype(int), len(p) - 4)
    u = (t - i)[:, None]
    a, b, c, d = (p[i + k] for k in range(4))
    return np.asarray(0.5 * (2 * b + (c - a) * u + (2 * a - 5 * b + 4 * c - d) * u**2 + (3 * b - a - 3 * c + d) * u**3))


def strand(points: ArrayLike | Sequence[Place], radii: Sequence[float], pieces: int) -> list[Shape]:
    """Limbs along a curve through (N, 3) points whose radii are given at both ends and evenly between."""
    p = np.asarray(points, np.float64)
    places = curve(p, pieces + 1)
    widths = np.interp(np.linspace(0, 1, pieces + 1), np.linspace(0, 1, len(radii)), radii)
    return [limb(places[i], places[i + 1], float(widths[i]), float(widths[i + 1])) for i in range(pieces)]


def spin(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Floats:
    """4×4 of turns in degrees about X, then Y, then Z."""
    (cx, sx), (cy, sy), (cz, sz) = ((math.cos(math.radians(a)), math.sin(math.radians(a))) for a in (x, y, z))
    about_x = np.array([[1, 0, 0, 0], [0, cx, -sx, 0], [0, sx, cx, 0], [0, 0, 0, 1]])
    about_y = np.array([[cy, 0, sy, 0], [0, 1, 0, 0], [-sy, 0, cy, 0], [0, 0, 0, 1]])
    about_z = np.array([[cz, -sz, 0, 0], [sz, cz, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x, np.float64)


def about(place: Place, turn: Floats) -> Floats:
    """4×4 of a turn about a place instead of 0."""
    to, back = np.eye(4), np.eye(4)
    to[:3, 3], back[:3, 3] = place, np.negative(place)
    return np.asarray(to @ turn @ back)


def rows(matrix: Floats) -> Mat4:
    """A 4×4 array as the tuples that a scene keeps."""
    a, b, c, d = ((float(r[0]), float(r[1]), float(r[2]), float(r[3])) for r in matrix)
    return (a, b, c, d)


def nearer(shape: Shape, eye: Sequence[float], factor: float) -> Shape:
    """Shrunk towards an eye, which sees the same: scenery far away that keeps the scene's box small."""
    x, y, z = eye
    return shape.at(-x, -y, -z).scale(factor).at(x, y, z)
