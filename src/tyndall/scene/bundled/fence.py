"""`fence`: an iron railing on dunes of dry grass; the late sun draws every bar across the ground.

The hard case of thin casters and grazing light. The bars are 12 mm thick, half a texel of a 1024² shadow map of the
whole scene, and the twigs of the sapling less. The sun stands 10.5° high: shadows are five times as long as what casts
them, run over slopes that turn away from the light, and move by five times a bias of their depth.
It has the sun's true angular diameter, 0.0093 rad: behind 1.3 m of its shadow a bar is thinner than the sun, and the
shadow pales. Techniques that take every light for a point keep it black.

The ground is 18 m by 14 m, a closed slab; it falls away behind a low crest.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tyndall.scene.bundled import textures
from tyndall.scene.bundled.primitives import (
    Floats,
    Geometry,
    lathe,
    merge,
    repeat,
    rounded_box,
    sheet,
    smooth_path,
    spindle,
    translation,
    tube,
)
from tyndall.scene.bundled.sunlight import Options, suns
from tyndall.scene.model import Camera, Instance, Material, Scene, Vec3

TRIANGLES = 49_894

WEST, EAST, NORTH, SOUTH = -9.0, 9.0, -8.0, 6.0
SUN: Vec3 = (0.42, -0.185, 0.90)
SUN_DIAMETER = 0.0093
BAR, PITCH = 0.006, 0.115  # radius of a bar, and distance from one to the next
LINE = (
    (7.2, 0.9),
    (4.4, -0.1),
    (2.0, -0.2),
    (-0.2, -1.1),
    (-2.4, -2.7),
    (-5.0, -3.5),
    (-8.6, -3.6),
)  # x, z of the fence


def ground(x: Floats, z: Floats) -> Floats:
    """Height of the dunes in metres."""
    rolling = 0.13 * np.sin(0.62 * x + 0.35 * z + 0.6) + 0.09 * np.sin(0.95 * z - 0.42 * x + 2.0)
    ripples = 0.026 * np.sin(2.3 * x + 1.1 * z + 0.9 * np.sin(0.8 * z)) + 0.014 * np.sin(4.6 * z - 2.1 * x)
    crest = 0.35 * np.exp(-(((z + 5.2 + 0.15 * x) / 1.6) ** 2)) - 0.5 * np.clip((-5.5 - z) / 2.5, 0, 1) ** 2
    return np.asarray(rolling + ripples + crest)


def _ground() -> Geometry:
    """The slab: the dunes, four sides, and a bottom."""
    x, z = np.meshgrid(np.linspace(WEST, EAST, 97), np.linspace(SOUTH, NORTH, 73))
    top = np.stack([x, ground(x, z), z], -1)
    rim = np.concatenate([top[0, :-1], top[:-1, -1], top[-1, :0:-1], top[:0:-1, 0]])
    foot = rim * (1, 0, 1) - (0, 0.8, 0)
    middle = np.broadcast_to(np.array(((WEST + EAST) / 2, -0.8, (NORTH + SOUTH) / 2)), foot.shape)
    surface = sheet(top)
    surface = Geometry(surface.positions, surface.normals, surface.positions[:, [0, 2]].copy(), surface.indices)
    return merge([surface, sheet(np.stack([foot, rim]), wrap=True), sheet(np.stack([middle, foot]), wrap=True)])


def _way() -> Floats:
    """Points (N, 2) on the fence's line, 1 cm apart."""
    path = smooth_path(np.insert(np.asarray(LINE), 1, 0.0, axis=1), 200)[:, [0, 2]]
    far = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.arange(0, far[-1], 0.01)
    return np.stack([np.interp(at, far, path[:, k]) for k in (0, 1)], 1)


def _standing(part: Geometry, places: Floats) -> Geometry:
    """Copies of a part on the ground at (N, 2) places."""
    matrices = np.tile(np.eye(4), (len(places), 1, 1))
    matrices[:, 0, 3], matrices[:, 2, 3] = places.T
    matrices[:, 1, 3] = ground(places[:, 0], places[:, 1])
    return repeat(part, matrices)


def _railing() -> tuple[Geometry, Geometry]:
    """Bars with their points and the two rails; and the posts."""
    path = _way()
    bar = tube([(0, -0.03, 0), (0, 1.12, 0)], BAR, 6)
    point = lathe([(0, 1.1), (0.011, 1.105), (0.011, 1.118), (0.006, 1.128), (0.017, 1.16), (0, 1.245)], 8)
    bars = _standing(merge([bar, point]), path[:: round(100 * PITCH)])
    rails = []
    for height, radius in ((0.16, 0.011), (0.98, 0.011), (1.05, 0.0045)):
        line = path[::16]
        rails.append(tube(np.stack([line[:, 0], ground(*line.T) + height, line[:, 1]], 1), radius, 6))
    post = [
        rounded_box((-0.035, -0.1, -0.035), (0.035, 1.22, 0.035), 0.006),
        lathe([(0, 1.21), (0.05, 1.215), (0.05, 1.235), (0.02, 1.25), (0.028, 1.265), (0.052, 1.30), (0.052, 1.33),
               (0.03, 1.362), (0, 1.37)], 14),
    ]  # fmt: skip
    return merge([bars, *rails]), _standing(merge(post), path[3 :: round(PITCH * 100) * 20])


def _stone(rng: np.random.Generator, x: float, z: float, size: float) -> Geometry:
    """A boulder that the ground half swallows."""
    polar = (np.arange(13) + 1) * (math.pi / 14)
    angle = np.arange(24) * (2 * math.pi / 24)
    across, up = np.sin(polar)[:, None], -np.cos(polar)[:, None]
    direction = np.stack([across * np.cos(angle), up + 0 * angle, -across * np.sin(angle)], -1)

    def surface(d: Floats) -> Floats:
        radius = np.ones(d.shape[:-1])
        for axis, phase in zip(axes, phases, strict=True):
            radius = radius + 0.09 * np.sin(2.6 * (d @ axis) + phase)
        return size * radius[..., None] * d * (1.25, 0.72, 0.95)

    axes, phases = rng.normal(0, 1, (5, 3)), rng.uniform(0, 6.3, 5)
    low, high = surface(np.array((0, -1.0, 0))), surface(np.array((0, 1.0, 0)))
    return spindle(surface(direction), low, high).at(x, float(ground(np.array(x), np.array(z))) + 0.25 * size, z)


def _sapling(rng: np.random.Generator, x: float, z: float) -> Geometry:
    """A bare young tree, tied to nothing."""
    parts: list[Geometry] = []

    def grow(start: Floats, heading: Floats, length: float, radius: float, level: int) -> None:
        steps = [start]
        for _ in range(4):
            heading = heading + rng.normal(0, 0.13, 3) + np.array((0, 0.06, 0))
            heading /= np.linalg.norm(heading)
            steps.append(steps[-1] + heading * length / 4)
        path = smooth_path(np.array(steps), 3)
        parts.append(tube(path, np.linspace(radius, 0.5 * radius, len(path)), (10, 7, 5, 4)[level]))
        if level == 3:
            return
        for k in range((7, 4, 3)[level]):
            t = 0.38 + 0.6 * (k + rng.random()) / (7, 4, 3)[level]
            root = np.array([np.interp(t * (len(path) - 1), np.arange(len(path)), path[:, i]) for i in range(3)])
            turn = 2.4 * k + rng.normal(0, 0.4)
            out = np.array((math.cos(turn), 0.55, math.sin(turn)))
            aim = 0.62 * out / np.linalg.norm(out) + 0.5 * heading
            grow(root, aim / np.linalg.norm(aim), length * (0.5 - 0.1 * t), radius * 0.42, level + 1)

    grow(np.array((0, -0.05, 0)), np.array((0.06, 1.0, 0.02)), 2.3, 0.032, 0)
    return merge(parts).placed(translation(x, float(ground(np.array(x), np.array(z))), z))


def fence(lights: int = 1, seed: int = 0) -> Scene:
    """An iron railing on dunes in the last sun: bars thinner than a shadow map's texel, in grazing light.

    Args:
        lights: 1 to 32 directional lights, each as wide in the sky as the sun.
        seed: of textures, stones and the sapling.

    Raises:
        ParameterError: ``lights`` or ``seed`` is not a whole number in range.
    """
    options = Options(lights, seed)
    rng = np.random.default_rng(options.seed)
    grass = Material(
        "dry grass", roughness=1.0, base_color=(1, 1, 1, 1),
        base_color_texture=textures.mottled(rng, "grass", (0.50, 0.42, 0.24), (0.72, 0.62, 0.38), beta=1.3, metres=3.1),
    )  # fmt: skip
    iron = Material("iron", base_color=(0.035, 0.045, 0.045, 1), roughness=0.5)
    rock = Material("rock", base_color=(0.40, 0.33, 0.27, 1), roughness=0.9)
    bark = Material("bark", base_color=(0.20, 0.13, 0.09, 1), roughness=0.9)
    bars, posts = _railing()
    boulders = ((-2.45, 0.75, 0.33), (-1.85, 1.1, 0.16), (3.4, -3.4, 0.5), (1.9, 1.9, 0.13))  # x, z, size
    stones = merge([_stone(rng, *boulder) for boulder in boulders])
    parts = {
        "ground": (_ground(), grass),
        "bars": (bars, iron),
        "posts": (posts, iron),
        "stones": (stones, rock),
        "sapling": (_sapling(rng, -3.3, -4.6), bark),
    }
    sunlight = suns(options.lights, SUN, 22.0, (1.0, 0.74, 0.46), (7, 16), spread=200)
    return Scene(
        instances=tuple(Instance(part.mesh(material, name), name=name) for name, (part, material) in parts.items()),
        lights=tuple(replace(light, angular_diameter=SUN_DIAMETER) for light in sunlight),
        camera=Camera((0.3, 1.5, 5.2), (-0.15, 0.35, -0.9), fov=math.radians(40), exposure=0.0),
        background=(0.95, 0.60, 0.36),
        ambient=(0.15, 0.165, 0.21),
        name="fence",
    )
