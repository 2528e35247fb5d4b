"""`shadows`: sculptures that float above a floor before two walls; any number of triangles, any number of lights.

This is the test scene of S4's comparison of shadow techniques, which has 10 to 100,000 triangles and 1 to 5 lights. The
floor and the two walls have two triangles each (an odd total gives the floor a third); the rest is shared out among
the sculptures. The forms, and with them the shadows, are the same at every size from about 400 triangles on: only their
facets become finer, so that two sizes differ in the work and not in the picture. Smaller sizes have fewer and simpler
forms, down to a single tetrahedron. Sculptures of fewer than 500 triangles are faceted, the others smooth.

The sculptures are closed surfaces, at most eight meshes, on each of whose edges exactly two triangles meet; smooth ones
have no vertex twice. Materials are plain, and nothing is in the air. Lights alternate between spots and directional
ones from the open sides, each with its own tint; together they bring the illuminance of one. Their size is 0: sharp
shadows, as S4 has them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tyndall.gpu.params import check, param
from tyndall.scene.bundled.primitives import (
    Floats,
    Geometry,
    faceted,
    flat,
    refine,
    ring,
    rotation,
    scaling,
    spindle,
    torus_knot,
    translation,
)
from tyndall.scene.bundled.sunlight import GOLDEN_RATIO
from tyndall.scene.model import Camera, DirectionalLight, Instance, Light, Material, Scene, SpotLight, Vec3

TRIANGLES = 1000

SIZE, HEIGHT = 9.0, 5.4  # of the square floor, and of the walls x = 0 and z = 0
CENTRE = np.array((3.3, 1.5, 3.3))  # what the lights and the camera look at
ILLUMINANCE = 7.0
FACETED = 500  # a sculpture with fewer triangles shows them


@dataclass(frozen=True)
class Options:
    """What the scene can be asked for.

    Raises:
        ParameterError: a value that is not a whole number in range.
    """

    triangles: int = param(TRIANGLES, 10, 10_000_000, "triangles of the whole scene, exactly")
    lights: int = param(1, 1, 32, "lights, spots and directional ones in turns")
    seed: int = param(0, 0, 2**32 - 1, "seed of the sculptures' turns")

    def __post_init__(self) -> None:
        check(self)


# --- sculptures ---------------------------------------------------------------------------------------------------


def _grid(triangles: int, slender: float, fewest: int) -> tuple[int, int]:
    """(rows, columns) of a grid of at most ``triangles`` = 2·rows·columns, about ``slender`` times as many rows."""
    ideal = math.sqrt(triangles / 2 / slender)
    columns = range(max(3, round(0.85 * ideal)), max(3, round(1.15 * ideal)) + 1)
    best = min(
        columns, key=lambda n: (triangles % (2 * n), abs(n - ideal)) if triangles >= 2 * n * fewest else (1e9, n)
    )
    return triangles // (2 * best), best


def _around(count: int) -> tuple[Floats, Floats]:
    angle = np.arange(count) * (2 * math.pi / count)
    return np.cos(angle), np.sin(angle)


def _knot(triangles: int) -> Geometry:
    rows, columns = _grid(triangles, 7.0, 24)
    return torus_knot((2, 3), (0.78, 0.34, 0.215), rows, columns)


def _hoop(triangles: int) -> Geometry:
    """A round ring about +Z."""
    rows, columns = _grid(triangles, 2.6, 6)
    (cos, sin), (c, s) = _around(rows), _around(columns)
    distance = 0.72 + 0.13 * c
    points = np.stack([distance * cos[:, None], distance * sin[:, None], -0.13 * s + 0 * cos[:, None]], -1)
    return ring(points)


def _band(triangles: int) -> Geometry:
    """A ring of flat section about +Z that twists by a whole turn on its way round."""
    rows, columns = _grid(triangles, 2.6, 6)
    (cos, sin), (c, s) = _around(rows), _around(columns)
    twist = np.arange(rows) * (2 * math.pi / rows)
    flat_x, flat_y = 0.30 * c, 0.075 * s
    x = flat_x * np.cos(twist)[:, None] - flat_y * np.sin(twist)[:, None]
    y = flat_x * np.sin(twist)[:, None] + flat_y * np.cos(twist)[:, None]
    distance = 0.78 + x
    return ring(np.stack([distance * cos[:, None], distance * sin[:, None], -y], -1))


def _ball(triangles: int) -> Geometry:
    if triangles < 16:
        return _double_pyramid(triangles)
    rows, columns = _grid(triangles, 0.5, 2)
    polar = (np.arange(rows) + 1) * (math.pi / (rows + 1))
    cos, sin = _around(columns)
    radius, height = np.sin(polar)[:, None], -np.cos(polar)[:, None]
    return spindle(np.stack([radius * cos, height + 0 * cos, -radius * sin], -1), (0, -1, 0), (0, 1, 0))


def _double_pyramid(triangles: int) -> Geometry:
    """A tetrahedron, or a pyramid upwards and one downwards."""
    if triangles == 4:
        corners = np.array([(1, -1, -1), (-1, -1, 1), (1, 1, 1), (-1, 1, -1)]) / math.sqrt(3)
        indices = np.array([(0, 2, 1), (0, 3, 2), (0, 1, 3), (1, 2, 3)], np.uint32)
        turned = (corners @ rotation("x", 0.6155)[:3, :3].T @ rotation("z", 0.7854)[:3, :3].T).astype(np.float32)
        return Geometry(turned, turned, np.zeros((4, 2), np.float32), indices)
    cos, sin = _around(triangles // 2)
    return spindle(np.stack([cos, 0 * cos, -sin], -1)[None], (0, -1.15, 0), (0, 1.15, 0))


def _bud(triangles: int) -> Geometry:
    """A fluted and twisted bud, pointed at its ends."""
    if triangles < 60:
        return _double_pyramid(triangles)
    rows, columns = _grid(triangles, 0.7, 3)
    t = ((np.arange(rows) + 1) / (rows + 1))[:, None]
    angle = np.arange(columns) * (2 * math.pi / columns) + 2.2 * t
    flutes = 0.16 * np.cos(6 * (angle - 2.2 * t)) if columns >= 20 else 0.0
    radius = np.sin(math.pi * t**0.8) ** 0.85 * (1 + flutes)
    height = 2.5 * t - 1.2
    points = np.stack([radius * np.cos(angle), height + 0 * angle, -radius * np.sin(angle)], -1)
    return spindle(points, (0, -1.25, 0), (0, 1.35, 0))


def _column(triangles: int) -> Geometry:
    """A square prism with rounded edges that twists by a third of a turn, 2 units tall."""
    rows, columns = (triangles // 8, 4) if triangles < 200 else _grid(triangles, 1.6, 6)
    t = np.linspace(-1, 1, rows)[:, None]
    cos, sin = _around(columns)
    square = 1.36 if columns < 12 else (cos**8 + sin**8) ** -0.125
    end = (1 - np.abs(0.985 * t) ** 14) ** (1 / 3) if rows > 8 else 1.0
    turn = min(2.1, 0.3 * rows) * (t + 1) / 2
    x, z = 0.3 * square * end * cos, -0.3 * square * end * sin
    points = np.stack([x * np.cos(turn) + z * np.sin(turn), t + 0 * cos, z * np.cos(turn) - x * np.sin(turn)], -1)
    return spindle(points, (0, -1, 0), (0, 1, 0))


def _arch(triangles: int) -> Geometry:
    """Half a ring of square section on two legs, its feet at y = 0."""
    rows, columns = (triangles // 8, 4) if triangles < 240 else _grid(triangles, 2.4, 12)
    leg, radius = 0.9, 0.75
    way = np.linspace(0, 2 * leg + math.pi * radius, rows)
    bend = np.clip((way - leg) / radius, 0, math.pi)
    centre = np.stack([radius * np.cos(bend), np.minimum(way, way[::-1]).clip(0, leg) + radius * np.sin(bend)], 1)
    cos, sin = _around(columns)
    if columns < 12:
        cos, sin = (np.sqrt(0.5) * (cos - sin), np.sqrt(0.5) * (cos + sin))
        square = np.full(columns, 1.25)
    else:
        square = (cos**8 + sin**8) ** -0.125
    out, across = 0.17 * square * cos, -0.17 * square * sin
    x = centre[:, :1] + out * np.cos(bend)[:, None]
    y = centre[:, 1:] + out * np.sin(bend)[:, None]
    return spindle(np.stack([x, y, across + 0 * x], -1), (radius, 0, 0), (-radius, 0, 0))


@dataclass(frozen=True)
class _Sculpture:
    """A form, its place, and what it takes: the fewest triangles, and its share of those beyond."""

    name: str
    make: Callable[[int], Geometry]
    fewest: int
    share: float
    color: Vec3
    place: Vec3
    size: float
    pose: Vec3  # about X, then Y, then Z
    roughness: float = 0.6


# Those that come first are there in the smallest scenes.
SCULPTURES = (
    _Sculpture("bud", _bud, 4, 0.10, (0.46, 0.16, 0.36), (1.3, 1.15, 4.75), 0.62, (0.15, 0.4, -0.12)),
    _Sculpture("ball", _ball, 8, 0.08, (0.20, 0.36, 0.66), (4.95, 1.0, 2.75), 0.55, (0, 0.3, 0)),
    _Sculpture("column", _column, 16, 0.10, (0.10, 0.40, 0.40), (0.95, 1.62, 3.1), 1.4, (0, 0.2, 0)),
    _Sculpture("hoop", _hoop, 36, 0.10, (0.85, 0.62, 0.18), (4.4, 2.65, 1.3), 1.05, (0.3, 0.5, 0)),
    _Sculpture("arch", _arch, 48, 0.10, (0.40, 0.50, 0.33), (5.3, 0.004, 1.75), 1.0, (0, 0.65, 0)),
    _Sculpture("pearl", _ball, 16, 0.06, (0.82, 0.78, 0.70), (2.35, 3.35, 2.2), 0.36, (0, 0, 0)),
    _Sculpture("band", _band, 48, 0.12, (0.72, 0.72, 0.70), (2.0, 0.62, 5.75), 0.55, (1.2, 0, 0.2)),
    _Sculpture("knot", _knot, 192, 0.34, (0.80, 0.23, 0.13), (3.25, 1.75, 3.25), 1.0, (0.25, 0.75, 0.0)),
)


def _budgets(triangles: int) -> list[int]:
    """Even numbers of triangles, one for each sculpture that there are enough for, with the sum ``triangles``."""
    count, spent = 0, 0
    while count < len(SCULPTURES) and spent + SCULPTURES[count].fewest <= triangles:
        spent += SCULPTURES[count].fewest
        count += 1
    chosen = SCULPTURES[:count]
    spare, shares = triangles - spent, sum(s.share for s in chosen)
    budgets = [s.fewest + 2 * int(spare * s.share / shares / 2) for s in chosen]
    budgets[-1] += triangles - sum(budgets)
    return budgets


def _sculpture(which: _Sculpture, triangles: int, alone: bool, turn: float) -> Instance:
    part = which.make(triangles)
    part = refine(part, triangles - part.triangle_count)
    if triangles < FACETED:
        part = faceted(part)
    place, size = ((3.3, 1.7, 3.3), 1.25) if alone else (which.place, which.size)
    x, y, z = which.pose
    pose = rotation("y", y + turn) @ rotation("x", x) @ rotation("z", z)
    part = part.placed(translation(*place) @ pose @ scaling(size, size, size))
    material = Material(which.name, (*which.color, 1), roughness=which.roughness)
    return Instance(part.mesh(material, which.name), name=which.name)


# --- room and lights ----------------------------------------------------------------------------------------------


def _room(odd: bool) -> list[Instance]:
    s, h = SIZE, HEIGHT
    # A corner in the middle of the floor's first edge, from which the fan starts, makes three triangles of it.
    floor = flat([*([(s / 2, 0, s)] if odd else []), (s, 0, s), (s, 0, 0), (0, 0, 0), (0, 0, s)], (0, 1, 0))
    left = flat([(0, 0, 0), (0, h, 0), (0, h, s), (0, 0, s)], (1, 0, 0))
    right = flat([(0, 0, 0), (s, 0, 0), (s, h, 0), (0, h, 0)], (0, 0, 1))
    parts = {
        "floor": (floor, (0.50, 0.47, 0.43)),
        "left wall": (left, (0.62, 0.60, 0.56)),
        "right wall": (right, (0.62, 0.60, 0.56)),
    }
    return [
        Instance(part.mesh(Material(name, (*color, 1), roughness=0.9), name), name=name)
        for name, (part, color) in parts.items()
    ]


# Azimuth from +X towards +Z (the camera is at 45°) and elevation in degrees, and tint.
_LIGHTS: tuple[tuple[float, float, Vec3], ...] = (
    (96, 38, (1.0, 0.90, 0.76)),
    (2, 40, (0.60, 0.80, 1.0)),
    (200, 66, (1.0, 0.66, 0.72)),
    (60, 58, (0.76, 1.0, 0.74)),
    (28, 17, (1.0, 0.66, 0.36)),
)
DISTANCE = 6.2  # of spots from the middle


def _lights(count: int) -> tuple[Light, ...]:
    """``count`` lights that bring as much as one; the first has twice the share of each other."""
    lights: list[Light] = []
    for k in range(count):
        if k < len(_LIGHTS):
            azimuth, elevation, color = _LIGHTS[k]
        else:
            azimuth = -10 + 120 * (k * GOLDEN_RATIO % 1)
            elevation = 20 + 45 * (k * math.sqrt(3) % 1)
            color = (1.0, 0.86 + 0.12 * math.sin(2.4 * k), 0.86 + 0.14 * math.cos(1.7 * k))
        share = ILLUMINANCE * (2 if k == 0 else 1) / (count + 1)
        a, e = math.radians(azimuth), math.radians(elevation)
        towards = np.array((math.cos(e) * math.cos(a), math.sin(e), math.cos(e) * math.sin(a)))
        x, y, z = (float(v) for v in -towards)
        if k % 2:
            lights.append(DirectionalLight((x, y, z), share, color))
        else:
            distance = min(DISTANCE, (HEIGHT + 1.0 - CENTRE[1]) / math.sin(e))
            px, py, pz = (float(v) for v in CENTRE + distance * towards)
            lights.append(SpotLight((px, py, pz), (x, y, z), share * distance**2, color, 0.55, 0.85))
    return tuple(lights)


def shadows(triangles: int = TRIANGLES, lights: int = 1, seed: int = 0) -> Scene:
    """Sculptures above a floor before two walls: S4's test scene, of any number of triangles and lights.

    Args:
        triangles: of the whole scene, exactly; 10 or more. S4 has 10, 100, 1,000, 10,000 and 100,000.
        lights: 1 to 32: a spot light, a directional one, and so on in turns.
        seed: of the sculptures' turns.

    Raises:
        ParameterError: an option is not a whole number in range.
    """
    options = Options(triangles, lights, seed)
    odd = options.triangles % 2 == 1
    budgets = _budgets(options.triangles - 6 - odd)
    turns = np.random.default_rng(options.seed).uniform(-0.6, 0.6, len(SCULPTURES)) * (options.seed != 0)
    sculptures = [
        _sculpture(which, budget, len(budgets) == 1, float(turn))
        for which, budget, turn in zip(SCULPTURES, budgets, turns, strict=False)
    ]
    return Scene(
        instances=(*_room(odd), *sculptures),
        lights=_lights(options.lights),
        camera=Camera((8.4, 3.3, 8.4), (2.95, 1.62, 2.95), fov=math.radians(37), exposure=0.0),
        background=(0.02, 0.022, 0.026),
        ambient=(0.10, 0.105, 0.12),
        name="shadows",
    )
