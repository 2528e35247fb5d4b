"""`temple`: a Doric temple on a headland in the late sun, a little ruined; gulls circle it.

Sixteen flutes are one that is folded into a wedge of a sixteenth of a turn, so that a column costs few nodes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from tyndall.scene.bundled.sunlight import Options, suns
from tyndall.scene.model import Camera, Implicit, Material, Scene
from tyndall.sdf.scenes.parts import ball, egg, limb, nearer, paint, spin, strand
from tyndall.sdf.shape import Floats, Shape, Y, intersection, union
from tyndall.sdf.solids import box, ellipsoid, plane, rounded_box, torus

EYE = (-14.5, 1.9, 16.0)
SUN = (0.70, -0.42, -0.58)
SPACING = 2.5  # m, from column to column
FRONT, SIDE = 6, 8  # columns
STYLOBATE = 1.2  # m, its height; all columns stand on it
COLUMN = 5.4  # m, its height with the capital
SLOPE = math.radians(15.5)  # of the roof
HALF = SPACING * (FRONT - 1) / 2  # m, from the axis to the outer columns
BACK = -SPACING * (SIDE - 1)  # m, the last columns; the first are at 0
BIRDS = 7
FLIGHT = (9.0, 2.0)  # m, x and z of the middle of their round

MARBLE = paint("#e8d8ba", 0.7)
SHADED = paint("#d9c8aa", 0.8)
WORN = paint("#d6c8b2", 0.9)
BLUE = paint("#4d7a99", 0.8)
RED = paint("#b0563f", 0.8)
TILE = paint("#c0714a", 0.85)
EARTH = paint("#b8a06c", 1.0)
TURF = paint("#8b9a55", 1.0)
ROCK = paint("#a89c88", 0.95)
SEA = paint("#2f7fa8", 0.35)
HILLS = paint("#8796a8", 1.0)
CYPRESS = paint("#3c5a38", 1.0)
OLIVE = paint("#7f9160", 1.0)
BARK = paint("#6b5440", 0.95)
BRONZE = paint("#b98a4a", 0.35, metallic=1.0)
FIRE = paint("#ff9a3c", 0.9, glow=7.0)
FEATHER = paint("#f7f5ee", 0.9)


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> Shape:
    """A box between two corners."""
    size = tuple(b - a for a, b in zip(low, high, strict=True))
    x, y, z = ((a + b) / 2 for a, b in zip(low, high, strict=True))
    return box((size[0], size[1], size[2])).at(x, y, z)


def around(shape: Shape) -> Shape:
    """Sixteen copies around +Y of what lies along +X: the wedge of a sixteenth of a turn is unfolded four times."""
    for angle in (math.pi / 16, math.pi / 8, math.pi / 4):
        shape = shape.rotate(-angle, Y).mirror("xz" if angle > 0.7 else "z")
    return shape


def shaft(height: float, low: float = 0.47, high: float = 0.37) -> Shape:
    """A fluted shaft about +Y whose foot is at 0."""
    flute = limb((low + 0.035, 0.0, 0), (high + 0.03, height, 0), 0.088, 0.07)
    return limb((0, 0, 0), (0, height, 0), low, high) - around(flute)


def column(height: float = COLUMN) -> Shape:
    """A Doric column: shaft, ring, echinus and abacus."""
    top = height - 0.62
    capital = union(
        torus(0.375, 0.03).orient(Y).at(0, top + 0.02, 0),
        egg((0, top + 0.22, 0), (0.56, 0.24, 0.56)),
        block((-0.6, top + 0.3, -0.6), (0.6, height, 0.6)),
        smooth=0.03,
    )
    return union(shaft(top + 0.1), capital)


def stump(height: float, tilt: float, turn: float) -> Shape:
    """What is left of a column, broken off aslant."""
    cut = box((1.6, 2 * height, 1.6)).transform(spin(tilt, turn))
    chips = ball((0.3, height + 0.1, 0.2), 0.22)
    return intersection(shaft(COLUMN - 0.6), cut) - chips


def drum(length: float) -> Shape:
    """A piece of a shaft that lies along +Y."""
    return intersection(shaft(4.0, 0.46, 0.43).at(0, -2, 0), box((1.2, length, 1.2)))


def _columns() -> Shape:
    columns: list[Shape] = []
    for i in range(FRONT):
        x = SPACING * i - HALF
        columns.append(column().at(x, STYLOBATE, 0))
        columns.append(column().at(x, STYLOBATE, BACK))
    for j in range(1, SIDE - 1):
        for side in (-1, 1):
            x, z = side * HALF, -SPACING * j
            if side == 1 and j == 3:
                columns.append(stump(2.2, 16, 40).at(x, STYLOBATE, z))
            elif side == 1 and j == 4:
                columns.append(stump(0.9, -14, 10).at(x, STYLOBATE, z))
            else:
                columns.append(column().at(x, STYLOBATE, z))
    return union(*columns).material(MARBLE)


def _steps() -> Shape:
    steps = []
    for i in range(3):
        out = 0.95 + 0.5 * (2 - i)
        steps.append(
            block((-HALF - out, 0.4 * i - (1.5 if i == 0 else 0.02), BACK - out), (HALF + out, 0.4 * (i + 1), out))
        )
    chips = [
        ball((-HALF - 1.1, 0.85, 1.2), 0.3),
        ball((2.2, 0.5, 2.0), 0.26),
        ball((HALF + 1.0, 1.2, 0.9), 0.38),
        egg((-3.4, 1.25, 1.0), (0.35, 0.12, 0.18)),
    ]
    return (union(*steps) - union(*chips)).material(SHADED)


def _cella() -> Shape:
    y0, y1 = STYLOBATE, STYLOBATE + COLUMN
    outer = block((-HALF + 2.2, y0, BACK + 2.4), (HALF - 2.2, y1, -2.6))
    inner = block((-HALF + 2.7, y0 - 0.01, BACK + 2.9), (HALF - 2.7, y1 + 0.1, -3.1))
    door = block((-1.1, y0 - 0.01, -3.4), (1.1, y0 + 3.6, -2.3))
    frame = block((-1.35, y0, -2.75), (1.35, y0 + 3.85, -2.5)) - door
    return union((outer - union(inner, door)).material(SHADED), frame.material(MARBLE))


def _triglyph() -> Shape:
    body = box((0.62, 0.78, 0.1))
    grooves = [box((0.07, 0.66, 0.1)).at(x, -0.06, 0.06) for x in (-0.16, 0.16)]
    return body - union(*grooves)


def _frieze() -> list[Shape]:
    y = STYLOBATE + COLUMN + 1.2
    step = SPACING / 2
    result: list[Shape] = []
    for i in range(2 * FRONT - 1):
        x = step * i - HALF
        result.append(_triglyph().at(x, y, 0.66).material(BLUE))
        if i:
            result.append(_metope(i).at(x - step / 2, y - 0.02, 0.62).material(RED if i % 2 else MARBLE))
    for j in range(2 * SIDE - 1):
        z = -step * j
        result.append(_triglyph().rotate(-math.pi / 2, Y).at(-HALF - 0.66, y, z).material(BLUE))
    return result


def _metope(i: int) -> Shape:
    """A small relief: shields, and wreaths."""
    if i % 2:
        return union(torus(0.2, 0.035), egg((0, 0, 0), (0.1, 0.1, 0.05)))
    return union(egg((0, 0, 0), (0.23, 0.23, 0.06)), torus(0.15, 0.02).at(0, 0, 0.05))


def _gable(z: float, front: bool) -> list[Shape]:
    """Tympanum and the two slopes above it at a depth z."""
    y, half = STYLOBATE + COLUMN + 1.9, HALF + 1.25
    rise = half * math.tan(SLOPE)
    length = half / math.cos(SLOPE)
    field = intersection(
        block((-half, y, z - 0.35), (half, y + rise, z + 0.05)),
        box((2 * length, 4, 1))
        .rotate(SLOPE)
        .at(-half / 2 + 2 * math.sin(SLOPE), y + rise / 2 - 2 * math.cos(SLOPE), z),
        box((2 * length, 4, 1))
        .rotate(-SLOPE)
        .at(half / 2 - 2 * math.sin(SLOPE), y + rise / 2 - 2 * math.cos(SLOPE), z),
    )
    parts = [field.material(SHADED)]
    for side in (-1, 1):
        place = (side * half / 2, y + rise / 2 + 0.12, z + 0.12)
        parts.append(box((length + 0.16, 0.24, 0.85)).rotate(-side * SLOPE).at(*place).material(MARBLE))
    if front:
        parts.append(_relief().at(0, y + 0.78, z + 0.05).material(MARBLE))
    return parts


def _relief() -> Shape:
    """The sun between two reclining figures and their amphorae."""
    sun = union(
        egg((0, 0, 0), (0.42, 0.42, 0.16)),
        around(limb((0.5, 0, 0), (0.78, 0, 0), 0.055, 0.02)).orient((0, -1, 0)).rotate(math.pi / 2, (1, 0, 0)),
    ).at(0, 0.12, 0)
    parts: list[Shape] = [sun]
    for side in (-1, 1):
        body = [
            limb((side * 1.25, -0.35, 0.05), (side * 2.0, -0.5, 0.05), 0.22, 0.18),
            limb((side * 1.25, -0.35, 0.05), (side * 1.12, 0.1, 0.05), 0.2, 0.17),
            ball((side * 1.08, 0.42, 0.08), 0.15),
            limb((side * 2.0, -0.5, 0.05), (side * 2.55, -0.28, 0.05), 0.15, 0.11),
            limb((side * 2.55, -0.28, 0.05), (side * 3.1, -0.66, 0.05), 0.11, 0.08),
            limb((side * 1.15, 0.15, 0.1), (side * 0.8, -0.2, 0.16), 0.09, 0.07),
            limb((side * 1.2, 0.18, 0.05), (side * 1.62, -0.1, 0.14), 0.09, 0.07),
        ]
        parts.append(union(*body, smooth=0.1))
        parts.append(
            union(
                egg((side * 3.75, -0.5, 0), (0.2, 0.24, 0.16)),
                limb((side * 3.75, -0.4, 0), (side * 3.75, -0.1, 0), 0.07, 0.09),
                smooth=0.06,
            )
        )
    return union(*parts)


def _building() -> Shape:
    y, out = STYLOBATE + COLUMN, 0.62
    gap = 1.24
    ring = block((-HALF - out, y, BACK - out), (HALF + out, y + 1.6, out)) - block(
        (-HALF + out, y - 0.1, BACK + out), (HALF - out, y + 1.7, -out)
    )
    fillet = block(
        (-HALF - out - 0.07, y + 0.74, BACK - out - 0.07), (HALF + out + 0.07, y + 0.84, out + 0.07)
    ) - block((-HALF + gap, y, BACK + gap), (HALF - gap, y + 2, -gap))
    cornice = block((-HALF - 1.2, y + 1.6, BACK - 1.2), (HALF + 1.2, y + 1.9, 1.2))
    half = HALF + 1.25
    rise, length = half * math.tan(SLOPE), half / math.cos(SLOPE)
    roof: list[Shape] = []
    for side in (-1, 1):
        slab = box((length + 0.2, 0.16, -BACK + 2.3)).rotate(-side * SLOPE)
        roof.append(slab.at(side * half / 2, y + 1.9 + rise / 2 + 0.12, BACK / 2).material(TILE))
        for j in range(18):
            z = 0.6 + (BACK - 1.2) * j / 17
            low, high = (side * (half + 0.12), y + 1.9 + 0.19, z), (0.0, y + 1.9 + rise + 0.24, z)
            roof.append(limb(low, high, 0.09).material(TILE))
    ridge = limb((0, y + 1.9 + rise + 0.22, 1.1), (0, y + 1.9 + rise + 0.22, BACK - 1.1), 0.16).material(TILE)
    ruin = union(
        ball((HALF, y + 1.8, -3.5 * SPACING), 2.1),
        ball((HALF - 1.2, y + 2.6, -3.0 * SPACING), 1.5),
        ball((HALF - 0.6, y + 2.9, -4.4 * SPACING), 1.6),
        smooth=0.5,
    )
    body = union(ring, fillet, cornice).material(MARBLE)
    whole = union(body, *_frieze(), *_gable(0.7, True), *_gable(BACK - 0.7, False), *roof, ridge)
    return union(whole - ruin, _steps(), _cella(), *_crown(y + 1.9, rise))


def _crown(y: float, rise: float) -> list[Shape]:
    """Palmettes on the ridge and at the corners."""
    leaves = [
        egg((0.3 * math.sin(a), 0.34 * math.cos(a) + 0.1, 0), (0.09, 0.3, 0.07), spin(0, 0, -math.degrees(a)))
        for a in (-1.2, -0.6, 0.0, 0.6, 1.2)
    ]
    palmette = union(*leaves, ball((0, 0.05, 0), 0.16), smooth=0.05)
    half = HALF + 1.25
    return [
        palmette.scale(1.7).at(0, y + rise + 0.4, 0.9).material(MARBLE),
        palmette.at(-half + 0.1, y + 0.4, 0.9).material(MARBLE),
        palmette.at(half - 0.1, y + 0.4, 0.9).material(MARBLE),
    ]


# --- surroundings -------------------------------------------------------------------------------------------------


def _statue() -> Shape:
    """A robed figure on a pedestal who raises a bowl of fire."""
    pedestal = union(
        block((-0.75, -0.6, -0.75), (0.75, 0.25, 0.75)),
        block((-0.58, 0.2, -0.58), (0.58, 1.45, 0.58)),
        block((-0.7, 1.42, -0.7), (0.7, 1.6, 0.7)),
    ).material(SHADED)
    folds = [
        limb((0.34 * math.cos(a), 1.6, 0.3 * math.sin(a)), (0.17 * math.cos(a), 2.75, 0.14 * math.sin(a)), 0.1, 0.06)
        for a in np.linspace(0, 2 * math.pi, 9, endpoint=False)
    ]
    figure = union(
        limb((0, 1.7, 0), (0, 2.7, 0), 0.3, 0.21),
        *folds,
        limb((0, 2.7, 0), (0, 3.1, 0.01), 0.2, 0.23),
        limb((-0.2, 3.2, 0), (0.2, 3.2, 0), 0.13),
        limb((0, 3.25, 0), (0, 3.45, 0.02), 0.085, 0.08),
        egg((0, 3.58, 0.03), (0.135, 0.17, 0.15)),
        ball((0, 3.66, -0.11), 0.1),
        limb((0.26, 3.2, 0), (0.42, 3.55, 0.12), 0.085, 0.07),
        limb((0.42, 3.55, 0.12), (0.36, 3.95, 0.2), 0.07, 0.05),
        limb((-0.26, 3.2, 0), (-0.4, 2.8, 0.06), 0.085, 0.07),
        limb((-0.4, 2.8, 0.06), (-0.22, 2.62, 0.24), 0.07, 0.055),
        *strand([(-0.26, 3.3, 0.06), (0.02, 2.98, 0.25), (0.27, 2.72, 0.16)], (0.05, 0.06, 0.05), 3),
        smooth=0.06,
    ).material(MARBLE)
    bowl = (egg((0.36, 4.12, 0.2), (0.25, 0.16, 0.25)) - egg((0.36, 4.24, 0.2), (0.25, 0.15, 0.25))).material(BRONZE)
    fire = union(
        limb((0.36, 4.17, 0.2), (0.38, 4.5, 0.2), 0.12, 0.02),
        limb((0.3, 4.16, 0.24), (0.27, 4.36, 0.25), 0.08, 0.015),
        limb((0.43, 4.16, 0.17), (0.47, 4.33, 0.15), 0.07, 0.015),
        smooth=0.06,
    ).material(FIRE)
    return union(pedestal, figure, bowl, fire)


def _ruins() -> Shape:
    parts: list[Shape] = [
        drum(1.1).rotate(math.pi / 2).rotate(0.5, Y).at(5.3, 0.32, 4.6),
        drum(0.8).rotate(math.pi / 2, (1, 0, 0)).rotate(0.9, Y).at(7.2, 0.34, 3.9),
        drum(0.7).at(-8.6, 0.25, 4.6),
        drum(1.3).rotate(1.45).rotate(-0.7, Y).at(9.7, 0.3, 1.2),
        box((1.5, 0.55, 0.8)).transform(spin(0, 24, 9)).at(4.0, 0.18, 6.4),
        box((0.9, 0.6, 0.7)).transform(spin(12, -30, 4)).at(-9.9, 0.2, 3.7),
        box((0.6, 0.4, 0.5)).transform(spin(-14, 50, 10)).at(8.6, 0.12, 5.4),
        (column(1.3) & box((1.6, 1.6, 1.6)).at(0, 1.2, 0))
        .at(0, -0.9, 0)
        .transform(spin(0, 20, 104))
        .at(-6.2, 0.42, 5.9),
    ]
    return union(*parts).material(WORN)


def _ground(random: np.random.Generator) -> Shape:
    land = union(
        egg((0, -7.0, -6), (34, 7.1, 26)).material(TURF),
        egg((0, -3.02, -8), (17, 3.1, 19)).material(EARTH),
        egg((-20, -4.0, -18), (10, 5.6, 12)).material(TURF),
        egg((21, -5.0, -14), (11, 6.6, 12)).material(TURF),
        smooth=1.0,
    )
    stones: list[Shape] = []
    for k in range(22):
        angle, far = random.uniform(0.0, math.pi), random.uniform(1.0, 1.5)
        x, z = 11.0 * far * math.cos(angle), 2.0 + 6.5 * far * math.sin(angle)
        size = random.uniform(0.1, 0.34) * far
        turn = spin(random.uniform(-25, 25), random.uniform(0, 360), random.uniform(-25, 25))
        if k % 2:
            stone = rounded_box((2 * size, 1.1 * size, 1.4 * size), 0.35 * size).transform(turn)
        else:
            stone = ellipsoid((size, 0.5 * size, 0.75 * size)).transform(turn)
        stones.append(stone.at(x, 0.02, z))
    path = [
        egg(
            (random.uniform(-0.5, 0.5) + 0.9 * math.sin(0.5 * i), 0.07, 2.7 + 0.95 * i),
            (0.62, 0.07, 0.4),
            spin(0, 67 * i),
        )
        for i in range(10)
    ]
    land = intersection(land, box((64, 14, 54)).at(0, -1, -6))
    return union(land, union(*stones).material(ROCK), union(*path).material(SHADED))


def _cypress(at: tuple[float, float, float], height: float) -> Shape:
    return union(
        limb((0, -0.4, 0), (0, 0.6, 0), 0.16).material(BARK),
        union(
            egg((0, 0.47 * height, 0), (0.13 * height, 0.45 * height, 0.13 * height)),
            egg((0.05 * height, 0.32 * height, 0.03 * height), (0.11 * height, 0.26 * height, 0.11 * height)),
            egg((-0.05 * height, 0.4 * height, 0), (0.1 * height, 0.3 * height, 0.11 * height)),
            smooth=0.12,
        ).material(CYPRESS),
    ).at(*at)


def _olive(at: tuple[float, float, float], size: float, random: np.random.Generator) -> Shape:
    trunk = union(
        *strand([(0, -0.3, 0), (0.15, 0.6, 0), (-0.05, 1.2, 0.1)], (0.3, 0.2, 0.16), 3),
        limb((0.05, 0.9, 0), (0.7, 1.6, 0.1), 0.13, 0.08),
        limb((0, 1.0, 0), (-0.6, 1.6, 0.1), 0.13, 0.08),
        smooth=0.1,
    ).material(BARK)
    crown = [
        egg((x, y + random.uniform(-0.1, 0.1), z), (r, 0.75 * r, r))
        for x, y, z, r in (
            (0, 2.15, 0, 0.75),
            (0.8, 1.95, 0.1, 0.6),
            (-0.8, 1.95, 0, 0.62),
            (0.3, 1.95, 0.6, 0.55),
            (-0.35, 2.0, -0.5, 0.6),
            (0.35, 2.5, -0.1, 0.5),
            (-0.4, 2.45, 0.2, 0.48),
        )
    ]
    return union(trunk, union(*crown, smooth=0.12).material(OLIVE)).scale(size).at(*at)


def _trees(random: np.random.Generator) -> Shape:
    return union(
        _cypress((-12.5, 0.2, -6.0), 8.5),
        _cypress((-14.2, 0.4, -9.5), 10.0),
        _cypress((-13.2, 0.4, -13.0), 7.5),
        _cypress((13.5, 0.1, -3.5), 9.0),
        _cypress((15.4, 0.1, -6.0), 7.0),
        _olive((17.5, 0.0, 4.0), 1.3, random),
        _olive((-17.5, 0.3, -3.0), 1.5, random),
    )


def _hills() -> Shape:
    ranges = [
        egg((-75, -8, -120), (48, 21, 12)),
        egg((-20, -8, -140), (46, 25, 12)),
        egg((40, -8, -130), (44, 19, 12)),
        egg((100, -8, -125), (50, 27, 12)),
    ]
    land = intersection(union(*ranges, smooth=4.0), block((-240, -12, -160), (240, 40, -100)))
    return nearer(land, EYE, 0.45)


def _bird() -> Shape:
    wings = [limb((0, 0, 0), (side * 0.42, 0.16, -0.02), 0.06, 0.045) for side in (-1, 1)] + [
        limb((side * 0.42, 0.16, -0.02), (side * 0.95, 0.05, -0.16), 0.045, 0.012) for side in (-1, 1)
    ]
    return union(limb((0, 0, 0.24), (0, 0, -0.26), 0.07, 0.03), *wings, smooth=0.04)


def _flight(time: float) -> Floats:
    """(:data:`BIRDS`, 4, 4) of the gulls' places."""
    k = np.arange(BIRDS)
    way = 0.16 * time + 2 * math.pi * ((k * 0.381966) % 1) * 0.5 + 2.4
    far, high = 8.0 + 2.2 * np.sin(2.1 * k), 9.2 + 1.3 * np.cos(1.7 * k) + 0.25 * np.sin(0.9 * time + 2 * k)
    bank = 0.42 + 0.16 * np.sin(1.3 * time + 1.9 * k)
    matrices = np.zeros((BIRDS, 4, 4))
    matrices[:, 3, 3] = 1
    forward = np.stack([-np.sin(way), 0 * way, np.cos(way)], 1)
    inward = np.stack([-np.cos(way), 0 * way, -np.sin(way)], 1)
    up = np.cos(bank)[:, None] * np.array([0, 1, 0]) + np.sin(bank)[:, None] * inward
    matrices[:, :3, 2], matrices[:, :3, 1], matrices[:, :3, 0] = forward, up, np.cross(up, forward)
    matrices[:, :3, 3] = np.stack([far * np.cos(way) + FLIGHT[0], high, far * np.sin(way) + FLIGHT[1]], 1)
    return matrices


REST = np.linalg.inv(_flight(0.0))


def motion(time: float) -> Mapping[str, ArrayLike]:
    """How the gulls have moved, (:data:`BIRDS`, 4, 4), at a time in seconds."""
    return {"gulls": _flight(time) @ REST}


def temple(*, lights: int = 1, seed: int = 0) -> Scene:
    """A Doric temple above the sea in the late sun: fluted columns, a relief, ruins, a statue with a bowl of fire.

    Args:
        lights: 1 to 32 directional lights; the first is the sun.
        seed: of the stones and the olive trees.

    Raises:
        ParameterError: an option is not a whole number in range.
    """
    options = Options(lights, seed)
    random = np.random.default_rng(options.seed)
    plain: dict[str, tuple[Shape, Material]] = {
        "columns": (_columns(), MARBLE),
        "building": (_building(), MARBLE),
        "statue": (_statue().rotate(-0.35, Y).at(-0.5, 0.0, 8.0), MARBLE),
        "ruins": (_ruins(), WORN),
        "ground": (_ground(random), TURF),
        "trees": (_trees(random), CYPRESS),
        "hills": (_hills(), HILLS),
        "sea": (plane().at(0, -3.0, 0), SEA),
    }
    birds = union(*(_bird().transform(m).named("gulls") for m in _flight(0.0))).material(FEATHER)
    return Scene(
        implicits=(
            *(Implicit(shape, material=material, name=name) for name, (shape, material) in plain.items()),
            Implicit(birds, material=FEATHER, name="birds"),
        ),
        lights=suns(options.lights, SUN, 9.0, (1.0, 0.80, 0.56), (20, 50), 200),
        camera=Camera(EYE, (-0.4, 4.6, -1.0), fov=math.radians(42), exposure=0.0),
        background=(0.22, 0.45, 0.92),
        ambient=(0.22, 0.28, 0.43),
        looks={"ray_traced_ao": {"radius": 2.0}},
        name="temple",
        motion=motion,
        room=((FLIGHT[0] - 12, 6.0, FLIGHT[1] - 12), (FLIGHT[0] + 12, 12.0, FLIGHT[1] + 12)),
    )
