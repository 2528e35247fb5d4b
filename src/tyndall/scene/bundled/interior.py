"""`interior`: toys on a carpet by lamplight, seen by one who hides under the table.

The hard case for shadow volumes: the camera is inside the shadow of a table top, a closed solid, so that the count of
volumes that a ray enters does not begin at zero; and the light stands inside an open mesh, a lampshade without
thickness, whose border is its silhouette. The room is closed. A trefoil knot throws its shadow on itself as well as on
the carpet, and a folded ribbon does so along its folds. The bulb has a radius of 3.5 cm: shadows are sharp at the feet
of things and wide at a distance.

Room: 5.4 m wide (x), 2.6 m high, 5.6 m deep (z), walls of closed slabs. Further lights are a spot on the wall, a
candle, and so on in turns, each a point or a spot with a size.
"""

from __future__ import annotations

import math

import numpy as np

from tyndall.scene.bundled import textures
from tyndall.scene.bundled.primitives import (
    Geometry,
    ball,
    cuboid,
    lathe,
    merge,
    plate,
    ribbon_solid,
    rotation,
    rounded_box,
    sheet,
    torus_knot,
    translation,
    tube,
)
from tyndall.scene.bundled.sunlight import GOLDEN_RATIO, Options
from tyndall.scene.model import Camera, Instance, Light, Material, PointLight, Scene, SpotLight, Vec3

TRIANGLES = 23_396

WIDTH, HEIGHT, BACK, FRONT, WALL = 5.4, 2.6, -3.0, 2.6, 0.2
BULB: Vec3 = (-2.1, 1.2, -0.5)
BULB_RADIUS = 0.035
INTENSITY = 56.0
TABLE_LOW, TABLE_HIGH = (-1.05, 0.70, 0.95), (1.05, 0.74, 2.15)  # of the table top


def _room() -> tuple[Geometry, Geometry, Geometry]:
    """Floor, walls with ceiling, and skirting."""
    x, w = WIDTH / 2, WALL
    floor = cuboid((-x - w, -w, BACK - w), (x + w, 0, FRONT + w))
    walls = [
        cuboid((-x - w, -w / 2, BACK - w), (-x, HEIGHT + w / 2, FRONT + w)),
        cuboid((x, -w / 2, BACK - w), (x + w, HEIGHT + w / 2, FRONT + w)),
        cuboid((-x - w, -w / 2, BACK - w), (x + w, HEIGHT + w / 2, BACK)),
        cuboid((-x - w, -w / 2, FRONT), (x + w, HEIGHT + w / 2, FRONT + w)),
        cuboid((-x - w, HEIGHT, BACK - w), (x + w, HEIGHT + w, FRONT + w)),
    ]
    skirting = [
        rounded_box((-x - 0.01, -0.01, BACK), (-x + 0.02, 0.11, FRONT), 0.008),
        rounded_box((x - 0.02, -0.01, BACK), (x + 0.01, 0.11, FRONT), 0.008),
        rounded_box((-x, -0.01, BACK - 0.01), (x, 0.11, BACK + 0.02), 0.008),
    ]
    return floor, merge(walls), merge(skirting)


def _table() -> Geometry:
    (x0, y0, z0), (x1, _, z1) = TABLE_LOW, TABLE_HIGH
    leg = lathe(
        [(0, 0), (0.022, 0), (0.026, 0.05), (0.018, 0.09), (0.030, 0.20), (0.034, 0.36), (0.026, 0.46), (0.032, 0.50),
         (0.032, y0 + 0.01), (0, y0 + 0.01)], 20
    )  # fmt: skip
    parts = [rounded_box(TABLE_LOW, TABLE_HIGH, 0.012, 2)]
    parts += [leg.at(x, 0, z) for x in (x0 + 0.09, x1 - 0.09) for z in (z0 + 0.09, z1 - 0.09)]
    parts += [
        rounded_box((x, y0 - 0.07, z0 + 0.07), (x + 0.02, y0 + 0.01, z1 - 0.07), 0.004) for x in (x0 + 0.08, x1 - 0.1)
    ]
    return merge(parts)


def _shade() -> Geometry:
    """The lampshade: a pleated cone, open above and below, without thickness."""
    angle = np.arange(72) * (2 * math.pi / 72)
    pleat = 1 + 0.025 * np.cos(24 * angle)
    x, y, z = BULB
    rings = []
    for radius, height in ((0.28, y - 0.09), (0.24, y - 0.02), (0.2, y + 0.05), (0.16, y + 0.12), (0.12, y + 0.19)):
        r = radius * pleat
        rings.append(np.stack([x + r * np.cos(angle), np.full(72, height), z - r * np.sin(angle)], 1))
    return sheet(np.stack(rings), wrap=True)


def _stand() -> Geometry:
    x, y, z = BULB
    foot = lathe(
        [(0, 0), (0.16, 0), (0.165, 0.015), (0.13, 0.03), (0.03, 0.05), (0.012, 0.09), (0.012, y - 0.2),
         (0.022, y - 0.18), (0.022, y - 0.08), (0, y - 0.08)], 28
    )  # fmt: skip
    return foot.at(x, 0, z)


def _ribbon() -> Geometry:
    """A folded ribbon on its edge: a plate whose waves bend towards each other."""
    t = np.linspace(0, 1, 97)
    wave = np.sin(t * 5 * math.pi)
    x = 1.05 * (t - 0.5) + 0.085 * np.sin(t * 10 * math.pi)
    z = 0.2 * wave * (0.55 + 0.45 * t)
    height = np.linspace(0.0, 1.0, 9)[:, None]
    lean = 0.05 * height**2
    tall = 0.3 + 0.08 * np.cos(t * 3 * math.pi)
    points = np.stack([x + 0 * height, 0.004 + height * tall, z + lean * wave], -1)
    return plate(points, 0.012)


def _tower() -> Geometry:
    """Rings of falling size on a peg."""
    parts = [lathe([(0, 0), (0.15, 0), (0.155, 0.01), (0.155, 0.025), (0.14, 0.035), (0.014, 0.036), (0.014, 0.33),
                    (0.03, 0.36), (0.026, 0.39), (0, 0.405)], 28)]  # fmt: skip
    y = 0.036
    for outer, thick in ((0.14, 0.036), (0.118, 0.033), (0.098, 0.03), (0.08, 0.027)):
        angle = np.arange(36) * (2 * math.pi / 36)
        circle = np.stack(
            [(outer - thick) * np.cos(angle), np.full(36, y + thick), -(outer - thick) * np.sin(angle)], 1
        )
        parts.append(tube(circle, thick, 16, closed=True))
        y += 2 * thick
    return merge(parts)


def _arch(low: float, high: float, depth: float) -> Geometry:
    """A half round arch of inner and outer radius, on its feet at y = 0."""
    angle = np.linspace(math.pi, 0, 25)
    circle = np.stack([np.cos(angle), np.sin(angle)], 1)
    return ribbon_solid(np.stack([low * circle, high * circle], 1), depth)


def _lights(count: int) -> tuple[Light, ...]:
    """The lamp, and ``count`` − 1 others that share half of its light."""
    lights: list[Light] = [PointLight(BULB, INTENSITY * 2 / (count + 1), (1.0, 0.76, 0.48), BULB_RADIUS)]
    for k in range(1, count):
        share = INTENSITY / (count + 1)
        turn = 2 * math.pi * (k * GOLDEN_RATIO + 0.22)
        x, z = 1.9 * math.cos(turn), -0.6 + 1.7 * math.sin(turn)
        if k % 2:
            down: Vec3 = (-0.55 * x, -2.3, -0.55 * (z + 0.6))
            lights.append(SpotLight((x, 2.4, z), down, 3.0 * share, (0.62, 0.78, 1.0), 0.25, 0.55, 0.04))
        else:
            lights.append(PointLight((x, 0.9 + 0.2 * math.sin(k), z), 0.3 * share, (1.0, 0.55, 0.30), 0.012))
    return tuple(lights)


def interior(lights: int = 1, seed: int = 0) -> Scene:
    """Toys by lamplight, seen from under a table: a camera in a shadow, a lamp in an open shade, self-shadowing curves.

    Args:
        lights: 1 to 32: the lamp, a spot under the ceiling, a candle, and so on in turns.
        seed: of the textures.

    Raises:
        ParameterError: ``lights`` or ``seed`` is not a whole number in range.
    """
    options = Options(lights, seed)
    rng = np.random.default_rng(options.seed)
    boards = Material(
        "boards", (1, 1, 1, 1), roughness=0.55,
        base_color_texture=textures.wood(rng, "boards", (0.36, 0.23, 0.14), (0.56, 0.39, 0.25), planks=8, metres=1.2),
    )  # fmt: skip
    wool = Material(
        "carpet", (1, 1, 1, 1), roughness=1.0,
        base_color_texture=textures.mottled(rng, "carpet", (0.28, 0.42, 0.48), (0.40, 0.54, 0.58), beta=0.7),
    )  # fmt: skip
    paper = Material(
        "wallpaper", (1, 1, 1, 1), roughness=0.95,
        base_color_texture=textures.mottled(rng, "wall", (0.74, 0.76, 0.68), (0.82, 0.83, 0.76), beta=2.0, metres=2.0),
    )  # fmt: skip
    oak = Material(
        "oak", (1, 1, 1, 1), roughness=0.5,
        base_color_texture=textures.wood(rng, "oak", (0.34, 0.21, 0.12), (0.50, 0.34, 0.20), size=256),
    )  # fmt: skip

    def plain(name: str, color: Vec3, roughness: float = 0.5, double_sided: bool = False) -> Material:
        return Material(name, (*color, 1), roughness=roughness, double_sided=double_sided)

    floor, walls, skirting = _room()
    knot = torus_knot((2, 3), (0.21, 0.09, 0.062), 192, 24).placed(
        translation(-0.5, 0.37, -1.3) @ rotation("y", 0.35) @ rotation("x", -0.15)
    )
    carpet = rounded_box((-1.5, -0.012, -2.4), (1.5, 0.012, 0.2), 0.008)
    blocks = merge(
        [
            rounded_box((-0.07, 0, -0.07), (0.07, 0.14, 0.07), 0.008, 2).at(0.66, 0.012, -0.75, 0.5),
            rounded_box((-0.07, 0, -0.07), (0.07, 0.14, 0.07), 0.008, 2).at(0.88, 0.012, -0.9, 0.1),
            rounded_box((-0.05, 0, -0.05), (0.05, 0.10, 0.05), 0.008, 2).at(0.75, 0.152, -0.82, 0.9),
        ]
    )
    parts: dict[str, tuple[Geometry, Material]] = {
        "floor": (floor, boards),
        "walls": (walls, paper),
        "skirting": (skirting, plain("paint", (0.70, 0.68, 0.62))),
        "carpet": (carpet, wool),
        "table": (_table(), oak),
        "lampshade": (_shade(), plain("parchment", (0.72, 0.58, 0.40), 0.9, double_sided=True)),
        "lamp stand": (_stand(), Material("brass", (0.78, 0.58, 0.28, 1), 1.0, 0.35)),
        "knot": (knot, plain("red lacquer", (0.72, 0.12, 0.07), 0.35)),
        "ribbon": (_ribbon().at(0.82, 0.012, -1.75, -0.15), plain("ribbon", (0.80, 0.74, 0.62), 0.7)),
        "rings": (_tower().at(0.1, 0.012, -2.05), plain("yellow", (0.82, 0.55, 0.10), 0.4)),
        "ball": (ball(0.16, 32, 20).at(0.05, 0.172, -0.85), plain("blue", (0.10, 0.24, 0.48), 0.4)),
        "arch": (_arch(0.13, 0.22, 0.09).at(-0.72, 0.012, -0.55, 0.45), plain("green", (0.20, 0.36, 0.18), 0.5)),
        "blocks": (blocks, plain("beech", (0.66, 0.48, 0.30), 0.6)),
    }
    return Scene(
        instances=tuple(Instance(part.mesh(material, name), name=name) for name, (part, material) in parts.items()),
        lights=_lights(options.lights),
        camera=Camera((0.8, 0.56, 1.5), (-0.21, 0.25, -0.78), fov=math.radians(41), exposure=0.6),
        ambient=(0.14, 0.14, 0.16),
        name="interior",
    )
