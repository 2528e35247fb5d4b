"""`swarm`: drops and grains that flow along a knot and melt into each other; any number of them, all moving on request.

They are one smooth union, in the order of a Morton curve (Morton 1966) through their places, so that what is near in
the balanced tree of the union is near in space. What moves them is a wave that is much longer than they are apart, so
that this stays so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.gpu.params import check, param
from tyndall.scene.bundled.sunlight import suns
from tyndall.scene.model import Camera, Implicit, Scene
from tyndall.sdf.scenes.parts import paint
from tyndall.sdf.shape import Floats, Shape, union
from tyndall.sdf.solids import plane, rounded_box, sphere

COUNT = 1000
SUN = (-0.5, -0.72, -0.48)
KNOT = 0.62  # m, of the knot's unit
THICK = 0.4  # m, how far from the knot's line
VOLUME = 5.5  # m³, about, of what is that near
WAVE = 0.16  # m, how far each moves
HEIGHT = 1.45  # m, of the knot's middle above the floor
COLORS = tuple(
    paint(c, 0.3)
    for c in (
        *("#1f5fa8", "#1f8fa8", "#2fae94", "#86c66a", "#f2cf4a", "#f4a23a"),
        *("#ee7038", "#e2485a", "#c23a86", "#8a3fa8", "#5a4bb8", "#3a55b4"),
    )
)
FLOOR = paint("#cfc8bb", 0.75)


@dataclass(frozen=True)
class Options:
    """What the scene can be asked for.

    Raises:
        ParameterError: a value that is not a whole number in range.
    """

    count: int = param(COUNT, 1, 100_000, "primitives that melt into each other")
    lights: int = param(1, 1, 32, "directional lights")
    seed: int = param(0, 0, 2**32 - 1, "seed of places, sizes and kinds")

    def __post_init__(self) -> None:
        check(self)


def morton(places: Floats, low: ArrayLike, high: ArrayLike) -> NDArray[np.uint64]:
    """(N,) keys of (N, 3) places between two corners: the bits of 21-bit coordinates, in turns."""
    unit = (places - np.asarray(low)) / np.subtract(high, low)
    cell = np.clip(unit * 2**21, 0, 2**21 - 1).astype(np.uint64)
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        cell = (cell | (cell << np.uint64(shift))) & np.uint64(mask)
    x, y, z = cell.T
    return np.asarray(x | (y << np.uint64(1)) | (z << np.uint64(2)))


def _knot(u: Floats) -> Floats:
    """(N, 3) places of the trefoil knot at parameters in radians."""
    away = 2 + np.cos(3 * u)
    return KNOT * np.stack([away * np.cos(2 * u), np.sin(3 * u), away * np.sin(2 * u)], 1)


class Motion:
    """Ways from their places at rest, (N, 3) in metres, at a time in seconds: a wave runs through the swarm.

    Attributes:
        places: (N, 3) at rest.
    """

    def __init__(self, places: Floats) -> None:
        self.places = places
        turned = places[:, [1, 2, 0]]
        self._phase = np.ascontiguousarray((1.9 * turned + 0.8 * places).astype(np.float32))
        self._rest = np.sin(self._phase)
        self._speed = np.array([1.3, 1.7, 1.1], np.float32)

    def __call__(self, time: float) -> Mapping[str, ArrayLike]:
        return {"swarm": np.float32(WAVE) * (np.sin(self._phase + np.float32(time) * self._speed) - self._rest)}


def _grain(kind: float, radius: float) -> Shape:
    if kind < 0.75:
        return sphere(radius)
    side = 1.55 * radius
    return rounded_box((side, side, side), 0.4 * radius)


def _swarm(count: int, seed: int) -> tuple[Shape, Floats]:
    random = np.random.default_rng(seed)
    u = 2 * math.pi * (np.arange(count) + random.uniform(0, 1, count)) / count
    away = random.normal(0, 1, (count, 3))
    away *= (THICK * random.uniform(0, 1, count) ** (1 / 3) / np.linalg.norm(away, axis=1))[:, None]
    places = _knot(u) + away * min(1.0, 0.35 + 0.2 * math.log10(count))
    mean = 0.4 * (VOLUME / count) ** (1 / 3)
    sizes = mean * random.uniform(0.55, 1.45, count) ** 1.5
    kinds, shades = random.uniform(0, 1, count), random.normal(0, 0.35, count)
    order = np.argsort(morton(places, places.min(axis=0), places.max(axis=0) + 1e-9), kind="stable")
    grains = []
    for i in order:
        color = COLORS[int(len(COLORS) * u[i] / (2 * math.pi) + shades[i]) % len(COLORS)]
        x, y, z = (float(v) for v in places[i])
        grains.append(_grain(float(kinds[i]), float(sizes[i])).named("swarm").at(x, y, z).material(color))
    return union(*grains, smooth=0.15 * mean), places[order]


def swarm(count: int = COUNT, lights: int = 1, seed: int = 0) -> Scene:
    """Drops and grains, any number of them, flow along a knot and melt into each other; animated.

    Args:
        count: how many; 1 to 100,000.
        lights: 1 to 32 directional lights.
        seed: of their places, sizes and kinds.

    Raises:
        ParameterError: an option is not a whole number in range.
    """
    options = Options(count, lights, seed)
    shape, places = _swarm(options.count, options.seed)
    stand = (0.0, HEIGHT, 0.0)
    drops = shape.at(*stand)
    low, high = (tuple(float(x) for x in corner) for corner in (drops.box[0] - 2 * WAVE, drops.box[1] + 2 * WAVE))
    return Scene(
        implicits=(
            Implicit(drops, material=COLORS[0], name="drops"),
            Implicit(plane(), material=FLOOR, name="floor"),
        ),
        lights=suns(options.lights, SUN, 6.5, (1.0, 0.93, 0.84), (35, 65), 200),
        camera=Camera((1.5, 3.9, 4.7), (0.0, 1.05, 0.1), fov=math.radians(39), exposure=0.0),
        background=(0.55, 0.56, 0.6),
        ambient=(0.26, 0.30, 0.38),
        name="swarm",
        motion=Motion(places),
        room=((low[0], low[1], low[2]), (high[0], high[1], high[2])),
    )
