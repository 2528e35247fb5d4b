"""`courtyard`: an arcaded patio with a fountain under two trees; the sun falls through their foliage.

The court is 12 m square, its fountain in the origin; a roofed arcade 3 m deep runs around it, 18.6 m square with its
walls. 5,608,441 triangles, most of them leaves: the two crowns and the ivy are one mesh of 1,080,000 leaves with 138 MB
of vertices, larger than one storage binding of many adapters; shrubs, columns, roofs and furniture are instanced.

Modelling takes some seconds, so its arrays are kept on disk (:mod:`~tyndall.scene.bundled.cache`). Grass between the
stones, one triangle a blade, makes up the exact count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tyndall.scene.bundled import cache, primitives, textures
from tyndall.scene.bundled.primitives import (
    Floats,
    Geometry,
    Matrix,
    cuboid,
    lathe,
    merge,
    pierced_wall,
    placements,
    plate,
    repeat,
    ribbon_solid,
    rotation,
    rounded_box,
    sheet,
    smooth_path,
    translation,
    tube,
)
from tyndall.scene.bundled.sunlight import Options, suns
from tyndall.scene.model import Camera, HenyeyGreenstein, Instance, Material, Medium, Scene, Texture, Vec3

TRIANGLES = 5_608_441

COURT, OUTER, WALL = 6.0, 9.0, 0.3  # half widths: columns, inner face of the outer walls; wall thickness
FLOOR = 0.14  # of the arcade, above the court
BAYS, BAY = 5, 2.4
SPRING, ARCH_TOP = 2.62, 4.15
EAVE, RIDGE = (5.55, 4.3), (9.35, 5.6)  # distance from the axis and height of the roof's edges
CROWN_LEAVES, IVY_LEAVES = 400_000, 280_000
TREES = ((-2.9, -2.3, 0.4), (3.0, 1.2, 2.1))  # x, z, turn
SUN: Vec3 = (0.36, -0.74, 0.50)
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
SIDES = tuple(rotation("y", k * math.pi / 2) for k in range(4))

Rng = np.random.Generator


@dataclass
class _Model:
    """Parts by name, and where each stands."""

    parts: dict[str, Geometry] = field(default_factory=dict)
    places: dict[str, Matrix] = field(default_factory=dict)

    def add(self, name: str, part: Geometry, places: Matrix | None = None) -> None:
        self.parts[name] = part
        self.places[name] = np.eye(4)[None] if places is None else np.asarray(places)

    @property
    def triangle_count(self) -> int:
        return sum(part.triangle_count * len(self.places[name]) for name, part in self.parts.items())


# --- leaves -------------------------------------------------------------------------------------------------------


def _leaves(rng: Rng, roots: Floats, heading: Floats, up: Floats, length: Floats, shades: int) -> Geometry:
    """Folded rhombic leaves of two triangles: (N, 3) roots, headings and upper sides (any length), (N,) lengths.

    u picks one of ``shades`` colours, v runs from root to tip.
    """
    one = np.float32
    roots, heading, up, length = roots.astype(one), heading.astype(one), up.astype(one), length.astype(one)[:, None]
    along = heading / np.sqrt(np.einsum("ij,ij->i", heading, heading))[:, None]
    side = np.cross(along, up)
    side /= np.maximum(np.sqrt(np.einsum("ij,ij->i", side, side)), 1e-6)[:, None]
    face = np.cross(side, along)
    count = len(roots)
    positions = np.empty((count, 4, 3), one)
    positions[:, 0] = roots
    positions[:, 2] = roots + along * length
    middle = roots + along * (0.42 * length) + face * (0.09 * length)
    positions[:, 1] = middle - side * (0.29 * length)
    positions[:, 3] = middle + side * (0.29 * length)
    # Both triangles rise from the midrib to the rim at 17°: normals lean inwards by as much.
    normals = np.empty_like(positions)
    normals[:, 0] = normals[:, 2] = face
    normals[:, 1] = face * one(0.956) + side * one(0.292)
    normals[:, 3] = face * one(0.956) - side * one(0.292)
    uvs = np.empty((count, 4, 2), one)
    uvs[..., 0] = ((rng.integers(0, shades, count) + 0.5) / shades)[:, None]
    uvs[..., 1] = (0.0, 0.45, 1.0, 0.45)
    base = np.arange(count, dtype=np.uint32)[:, None, None] * np.uint32(4)
    indices = base + np.array([[0, 2, 1], [0, 3, 2]], np.uint32)
    return Geometry(positions.reshape(-1, 3), normals.reshape(-1, 3), uvs.reshape(-1, 2), indices.reshape(-1, 3))


def _vector(*components: float) -> NDArray[np.float32]:
    return np.array(components, np.float32)


def _normal(rng: Rng, count: int) -> Floats:
    return rng.standard_normal((count, 3), np.float32)


def _crown_leaves(rng: Rng, tips: Floats, count: int) -> Geometry:
    """Leaves in tufts about the twigs' tips, (M, 3), which leave gaps for the sun."""
    tufts = np.repeat(tips, 5, axis=0)
    tufts = tufts + _normal(rng, len(tufts)) * _vector(0.15, 0.09, 0.15)
    at = np.arange(count) % len(tufts)
    cloud = _normal(rng, count)
    heading = cloud + 0.9 * _normal(rng, count) - _vector(0, 0.6, 0)
    up = 0.4 * cloud + 0.55 * _normal(rng, count) + _vector(0, 1.0, 0)
    spread = _vector(0.075, 0.05, 0.075)
    return _leaves(rng, tufts[at] + cloud * spread, heading, up, 0.048 + 0.03 * rng.random(count, np.float32), 16)


def _ivy(rng: Rng, count: int) -> Geometry:
    """Leaves that climb the outer walls and hang over the arcade's front, denser near the corners."""
    knots = 240
    around = rng.random(knots) * 8
    wall = around.astype(int) // 2
    t = (around % 2) - 1
    front = rng.random(knots) < 0.55
    # On the arcade's front the ivy keeps above the arches, on the walls it climbs from the ground.
    height = np.where(front, 3.75 + 0.55 * rng.random(knots), 0.2 + 3.6 * rng.random(knots) ** 1.4)
    reach = np.where(front, COURT - 0.24, OUTER - 0.02)
    width = np.where(front, 5.9, 8.8)
    corner = np.where(front, np.sign(t) * np.abs(t) ** 0.6, np.sign(t) * np.abs(t) ** 0.5) * width
    spread = np.where(front, 0.42, 0.6)
    at = rng.integers(0, knots, count)
    blob = _normal(rng, count)
    lateral = corner[at] + blob[:, 0] * spread[at]
    upward = height[at] + blob[:, 1] * spread[at] * np.where(front[at], 0.5, 1.1)
    hanging = front[at] & (upward < 3.85)
    upward = np.where(front[at], np.where(hanging, 3.85 - 0.3 * rng.random(count), upward), np.abs(upward))
    lateral = np.clip(lateral, -width[at], width[at])
    depth = reach[at] - 0.01 - 0.13 * np.abs(blob[:, 2]) * np.where(front[at], 1.0, 0.7)
    local = np.stack([lateral, np.minimum(upward, np.where(front[at], 4.6, 4.9)), -depth], 1)
    turn = wall[at] * (math.pi / 2)
    cos, sin = np.cos(turn), np.sin(turn)

    def spin(v: Floats) -> Floats:
        return np.stack([cos * v[:, 0] + sin * v[:, 2], v[:, 1], cos * v[:, 2] - sin * v[:, 0]], 1)

    heading = 0.6 * _normal(rng, count) + _vector(0, -0.8, 0.25)
    up = 0.45 * _normal(rng, count) + _vector(0, 0.45, 1.0)
    return _leaves(rng, spin(local), spin(heading), spin(up), 0.04 + 0.035 * rng.random(count), 16)


def _shrub(rng: Rng, count: int) -> Geometry:
    """A clipped round bush of radius 0.42 m whose centre is the origin."""
    out = _normal(rng, count)
    out /= np.sqrt(np.einsum("ij,ij->i", out, out))[:, None]
    lumps = 1 + 0.06 * np.sin(7 * out[:, 0] + 1) + 0.06 * np.sin(8 * out[:, 1] + 2) + 0.06 * np.sin(9 * out[:, 2])
    radius = 0.42 * lumps * (0.72 + 0.28 * rng.random(count) ** 0.5)
    heading = out + 0.7 * _normal(rng, count)
    up = out + 0.5 * _normal(rng, count) + _vector(0, 0.4, 0)
    return _leaves(rng, out * radius[:, None], heading, up, 0.026 + 0.014 * rng.random(count), 16)


def _grass(rng: Rng, count: int) -> Geometry:
    """Blades of one triangle: sparse in the joints of the court, dense along its rim and about the trees."""
    rim = rng.random(count) < 0.6
    t = rng.random(count) * 2 - 1
    side = rng.integers(0, 4, count) * (math.pi / 2)
    inward = COURT - 0.34 - 0.1 * np.abs(rng.standard_normal(count))
    tree = np.asarray(TREES)[rng.integers(0, 2, count)]
    angle, far = rng.random(count) * 2 * math.pi, 0.85 + 0.35 * rng.random(count) ** 2
    lateral = 5.6 * t
    x = np.where(rim, lateral * np.cos(side) + inward * np.sin(side), tree[:, 0] + far * np.cos(angle))
    z = np.where(rim, inward * np.cos(side) - lateral * np.sin(side), tree[:, 1] + far * np.sin(angle))
    root = np.stack([x, np.full(count, 0.005), z], 1)
    tall = 0.03 + 0.09 * rng.random(count) ** 2
    lean = rng.standard_normal((count, 3)) * 0.35
    lean[:, 1] = 1
    turn = rng.random(count) * math.pi
    across = np.stack([np.cos(turn), np.zeros(count), np.sin(turn)], 1) * 0.0035
    positions = np.stack([root - across, root + across, root + lean * tall[:, None]], 1).astype(np.float32)
    normal = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    uvs = np.empty((count, 3, 2), np.float32)
    uvs[..., 0] = ((rng.integers(0, 16, count) + 0.5) / 16)[:, None]
    uvs[..., 1] = (0, 0, 1)
    indices = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    return Geometry(
        positions.reshape(-1, 3), np.repeat(normal, 3, axis=0).astype(np.float32), uvs.reshape(-1, 2), indices
    )


# --- plants -------------------------------------------------------------------------------------------------------


def _tree(rng: Rng) -> tuple[Geometry, Floats]:
    """Trunk and branches of a tree 7 m tall on the origin, and the tips of its twigs, (M, 3)."""
    parts: list[Geometry] = []
    tips: list[Floats] = []

    def grow(start: Floats, heading: Floats, length: float, radius: float, level: int) -> None:
        points = [start]
        for _ in range(4):
            heading = heading + rng.normal(0, 0.16, 3) + np.array((0, 0.07 if level < 3 else -0.02, 0))
            heading /= np.linalg.norm(heading)
            points.append(points[-1] + heading * length / 4)
        path = smooth_path(np.array(points), 3)
        end = radius * (0.72 if level == 0 else 0.55)
        parts.append(tube(path, np.linspace(radius, end, len(path)), (22, 16, 12, 8, 6)[level]))
        if level == 4:
            tips.append(points[-1])
            return
        children = (6, 4, 3, 3)[level]
        basis = np.cross(heading, (1.0, 0.2, 0.1))
        basis /= np.linalg.norm(basis)
        other = np.cross(heading, basis)
        phase = rng.random() * 2 * math.pi
        for k in range(children):
            angle = phase + k * 2 * math.pi / children + rng.normal(0, 0.25)
            open_ = (0.85, 0.75, 0.75, 0.8)[level] * rng.uniform(0.75, 1.15)
            out = heading * math.cos(open_) + math.sin(open_) * (basis * math.cos(angle) + other * math.sin(angle))
            fork = path[-1] if k == 0 or level == 0 else path[len(path) - 1 - int(rng.integers(0, 5))]
            grow(fork, out, length * (0.72, 0.72, 0.66, 0.6)[level] * rng.uniform(0.85, 1.15), end * 0.8, level + 1)

    grow(np.array((0.0, -0.1, 0.0)), np.array((0.05, 1.0, 0.02)), 2.7, 0.2, 0)
    return merge(parts), np.array(tips)


def _sprays(rng: Rng, count: int, reach: float, droop: float) -> Geometry:
    """Curved cards for an alpha-masked spray of leaves, arching out from the origin like a fern."""
    rows, columns = 7, 3
    t = np.linspace(1, 0, rows)[:, None]
    u = np.linspace(-1, 1, columns)[None]
    card: list[Geometry] = []
    for k in range(count):
        steep = rng.uniform(0.5, 1.35)
        long = reach * rng.uniform(0.7, 1.1)
        bend = t * long
        out = np.sin(droop * t * 1.2 + (math.pi / 2 - steep)) * bend
        rise = np.cos(droop * t * 1.2 + (math.pi / 2 - steep)) * bend
        width = 0.3 * long
        points = np.stack([out + 0 * u, rise - 0.12 * width * np.abs(u), width * u + 0 * t], -1)
        part = sheet(points)
        flipped = Geometry(part.positions, part.normals, _vector(0, 1) + part.uvs * _vector(1, -1), part.indices)
        card.append(flipped.retextured((0, 0), (1, -1)).retextured((0, 1)).at(0, 0, 0, k * GOLDEN_ANGLE))
    return merge(card)


def _pot(radius: float, height: float) -> Geometry:
    """A thrown pot with a rolled rim, filled with earth."""
    r, h = radius, height
    return lathe(
        [(0, 0), (0.62 * r, 0), (0.66 * r, 0.02 * h), (0.86 * r, 0.42 * h), (0.95 * r, 0.8 * h), (0.94 * r, 0.86 * h),
         (1.04 * r, 0.88 * h), (1.07 * r, 0.93 * h), (1.05 * r, 0.985 * h), (0.99 * r, h), (0.92 * r, 0.98 * h),
         (0.88 * r, 0.9 * h), (0, 0.92 * h)], 64
    )  # fmt: skip


# --- architecture -------------------------------------------------------------------------------------------------


def _column() -> Geometry:
    """A Tuscan column with a square foot and abacus, from the arcade's floor to the springing of the arches."""
    top = SPRING - FLOOR
    shaft = np.linspace(0.17, top - 0.3, 40)
    swell = 0.165 - 0.028 * ((shaft - shaft[0]) / (shaft[-1] - shaft[0])) ** 1.8
    bead = np.linspace(-math.pi / 2, math.pi / 2, 9)
    torus = np.stack([0.185 + 0.035 * np.cos(bead), 0.115 + 0.035 * np.sin(bead)], 1)
    neck = np.stack([0.142 + 0.016 * np.cos(bead), top - 0.285 + 0.016 * np.sin(bead)], 1)
    echinus = np.stack(
        [0.145 + 0.075 * np.sin(np.linspace(0, math.pi / 2, 10)), np.linspace(top - 0.2, top - 0.12, 10)], 1
    )
    outline = np.concatenate(
        [[(0, 0.08)], torus, np.stack([swell, shaft], 1), neck, [(0.138, top - 0.262)], echinus, [(0, top - 0.12)]]
    )
    return merge(
        [
            rounded_box((-0.23, -0.02, -0.23), (0.23, 0.08, 0.23), 0.012, 3),
            lathe(outline, 48),
            rounded_box((-0.235, top - 0.12, -0.235), (0.235, top - 0.03, 0.235), 0.012, 3),
            rounded_box((-0.215, top - 0.03, -0.215), (0.215, top + 0.005, 0.215), 0.008, 2),
        ]
    )


def _arcade() -> Geometry:
    """The arched wall of one side, towards −Z, with mouldings and a cornice."""
    half, radius = BAY * BAYS / 2, BAY / 2 - 0.2
    xs, lows = [-half - 0.2], [SPRING]
    angle = np.linspace(math.pi, 0, 37)
    mouldings = []
    for k in range(BAYS):
        centre = -half + BAY * (k + 0.5)
        xs += list(centre + radius * np.cos(angle))
        lows += list(SPRING + radius * np.sin(angle) * 1.02)
        path = np.stack(
            [centre + (radius + 0.07) * np.cos(angle), SPRING + (radius * 1.02 + 0.07) * np.sin(angle), 0 * angle], 1
        )
        for z in (0.2, -0.2):
            mouldings.append(tube(path + (0, 0, z), 0.038, 14))
    xs.append(half + 0.2)
    lows.append(SPRING)
    outline = np.stack([np.stack([xs, lows], 1), np.stack([xs, np.full(len(xs), ARCH_TOP)], 1)], 1)
    wall = ribbon_solid(outline, 0.4).placed(translation(0, 0, -0.2))
    cornice = [
        rounded_box((-half - 0.26, ARCH_TOP - 0.2, -0.27), (half + 0.26, ARCH_TOP - 0.13, 0.27), 0.02, 3),
        rounded_box((-half - 0.24, ARCH_TOP - 0.08, -0.25), (half + 0.24, ARCH_TOP + 0.1, 0.25), 0.03, 3),
    ]
    return merge([wall, *mouldings, *cornice]).placed(translation(0, 0, -COURT))


def _roof(rng: Rng) -> tuple[Geometry, Geometry]:
    """Barrel tiles, and boards with rafters below, of one side's lean-to roof (towards −Z), mitred at the corners."""
    run, rise = RIDGE[0] - EAVE[0], RIDGE[1] - EAVE[1]
    slope, slant = math.atan2(rise, run), math.hypot(run, rise)
    pitch, course, long = 0.21, 0.36, 0.42
    t, s = np.meshgrid(np.linspace(0, math.pi, 9), np.linspace(0, 1, 5))
    taper = 0.105 - 0.018 * s
    cover = plate(np.stack([-taper * np.cos(t), 0.85 * taper * np.sin(t) + 0.018 * (1 - s), -long * s], -1), 0.014)
    pan = plate(np.stack([-taper * np.cos(t), -0.7 * taper * np.sin(t) + 0.018 * (1 - s), -long * s], -1), 0.014)
    column, row = np.meshgrid((np.arange(-46, 47)) * pitch, np.arange(math.floor(slant / course)), indexing="ij")
    column, row = column.ravel(), row.ravel()
    reach = EAVE[0] + (row + 0.5) * course * math.cos(slope)
    inside = np.abs(column) < reach - 0.04
    column, row = column[inside], row[inside]
    distance = row * course
    jitter = rng.normal(0, 1, (len(row), 3)) * (0.006, 0.004, 0.012)
    where = np.stack([column, np.full(len(row), 0.07), -distance], 1) + jitter
    turns = rng.normal(0, 0.025, len(row))
    tint = np.stack([rng.integers(0, 24, len(row)) / 24 + 1 / 48, np.full(len(row), 0.3)], 1)
    tiles = []
    for part, shift, lift in ((cover, 0.0, 0.035), (pan, pitch / 2, 0.0)):
        matrices = placements(where + (shift, lift, 0), turns)
        tiles.append(repeat(part.retextured(scale=(0, 0.3)), matrices, tint))
    ridge = np.stack([np.linspace(0, slant * 1.0, 60), np.full(60, 0.1), np.zeros(60)], 1)
    hip_length = math.hypot(math.sqrt(2) * run, rise)
    scallop = 0.1 + 0.012 * (np.linspace(0, 12, 60) % 1)
    hip = tube(ridge * (hip_length / slant, 1, 1), scallop, 14).retextured((0.3, 0.3), (0.0, 0.02))
    hip = hip.placed(
        translation(EAVE[0], EAVE[1], -EAVE[0])
        @ rotation("y", math.pi / 4)
        @ rotation("z", math.atan2(rise, math.sqrt(2) * run))
    )
    lay = translation(0, EAVE[1], -EAVE[0]) @ rotation("x", slope)
    surface = merge([merge(tiles).placed(lay), hip])
    corners = [
        [(-EAVE[0], EAVE[1], -EAVE[0]), (EAVE[0], EAVE[1], -EAVE[0])],
        [(-RIDGE[0], RIDGE[1], -RIDGE[0]), (RIDGE[0], RIDGE[1], -RIDGE[0])],
    ]
    boards = plate(np.array(corners), 0.05, (4.0, 1.5))
    rafters = []
    for x in np.arange(-8.5, 8.6, 0.5):
        start = max(0.0, (abs(x) - EAVE[0]) / math.cos(slope))
        if slant - start > 0.3:
            rafters.append(
                rounded_box((x - 0.045, -0.16, -slant + 0.02), (x + 0.045, -0.02, -start - 0.02), 0.008).placed(lay)
            )
    return surface, merge([boards, *rafters])


def _outer_wall() -> tuple[Geometry, Geometry]:
    """Wall of one side at z = −OUTER with three doorways, two windows and a coping; and its doors and shutters."""
    span, high = 2 * (OUTER + WALL), RIDGE[1] + 0.5
    openings = [
        (-4.8, 0.0, 1.2, 2.5),
        (0.0, 0.0, 1.5, 2.8),
        (4.8, 0.0, 1.2, 2.5),
        (-2.4, 1.0, 1.0, 1.4),
        (2.4, 1.0, 1.0, 1.4),
    ]
    holes = [(x - w / 2 + span / 2, y, x + w / 2 + span / 2, y + h) for x, y, w, h in openings]
    wall = pierced_wall((span, high), WALL, holes).placed(translation(-span / 2, FLOOR - 0.02, -OUTER - WALL))
    trims, wood = [], []
    for x, y, w, h in openings:
        base = y + FLOOR - 0.02
        for edge in (-1, 1):
            jamb = x + edge * (w / 2 + 0.04)
            trims.append(
                rounded_box((jamb - 0.07, base, -OUTER - 0.02), (jamb + 0.07, base + h + 0.14, -OUTER + 0.04), 0.012, 2)
            )
        trims.append(
            rounded_box(
                (x - w / 2 - 0.16, base + h - 0.02, -OUTER - 0.02),
                (x + w / 2 + 0.16, base + h + 0.16, -OUTER + 0.06),
                0.015,
                2,
            )
        )
        if y:
            trims.append(
                rounded_box(
                    (x - w / 2 - 0.16, base - 0.1, -OUTER - 0.02),
                    (x + w / 2 + 0.16, base + 0.01, -OUTER + 0.1),
                    0.015,
                    2,
                )
            )
        wood.append(cuboid((x - w / 2, base, -OUTER - 0.2), (x + w / 2, base + h, -OUTER - 0.16)))
        for leaf in (-1, 1):
            x0, x1 = sorted((x, x + leaf * w / 2))
            rows = 4 if not y else 3
            for r in range(rows):
                y0 = base + 0.06 + r * (h - 0.06) / rows
                wood.append(
                    rounded_box(
                        (x0 + 0.06, y0, -OUTER - 0.17),
                        (x1 - 0.06, y0 + (h - 0.06) / rows - 0.07, -OUTER - 0.135),
                        0.014,
                        2,
                    )
                )
    coping = rounded_box(
        (-span / 2 - 0.05, high + FLOOR - 0.06, -OUTER - WALL - 0.06),
        (span / 2 + 0.05, high + FLOOR + 0.06, -OUTER + 0.06),
        0.03,
        3,
    )
    return merge([wall, *trims, coping]), merge(wood)


def _arcade_floor() -> Geometry:
    """Raised floor of one side: a slab between court and wall, with a rounded step."""
    return merge(
        [
            cuboid((-OUTER - WALL, -0.3, -OUTER - WALL), (COURT - 0.28, FLOOR - 0.01, -COURT - 0.28)),
            rounded_box((-COURT + 0.28 - 0.56, -0.1, -COURT - 0.3), (COURT - 0.26, FLOOR, -COURT + 0.3), 0.025, 3),
            cuboid((-OUTER, FLOOR - 0.012, -OUTER), (OUTER - 3.2, FLOOR - 0.002, -COURT - 0.29)),
        ]
    )


def _cobbles(rng: Rng) -> Geometry:
    """Rounded stones in rings about the fountain, cut off at the arcade and left out under the trees."""
    steps = 7
    a = np.linspace(-1, 1, steps)
    u, v = np.meshgrid(a, a)
    rim = np.maximum(np.abs(u), np.abs(v))
    scale = np.sqrt(1 - 0.38 * np.minimum(u**2, v**2))
    dome = 0.034 * np.sqrt(np.clip(1 - 0.93 * rim**3, 0, 1)) - 0.012
    stone = sheet(np.stack([0.066 * u * scale, dome, -0.066 * v * scale], -1))
    pitch = 0.14
    radii = np.arange(1.78, 8.2, pitch)
    counts = (2 * math.pi * radii / pitch).astype(int)
    radius = np.repeat(radii, counts)
    start = np.repeat(np.cumsum(counts) - counts, counts)
    angle = (np.arange(len(radius)) - start + np.repeat(rng.random(len(radii)), counts)) * (
        2 * math.pi / np.repeat(counts, counts)
    )
    x, z = radius * np.cos(angle), radius * np.sin(angle)
    keep = (np.maximum(np.abs(x), np.abs(z)) < COURT - 0.33) & np.all(
        [np.hypot(x - tx, z - tz) > 0.95 for tx, tz, _ in TREES], axis=0
    )
    x, z, angle = x[keep], z[keep], angle[keep]
    count = len(x)
    where = np.stack([x, rng.normal(0, 0.0035, count), z], 1)
    matrices = placements(
        where, -angle + rng.normal(0, 0.06, count), rng.uniform(0.9, 1.06, count), rng.normal(0, 0.03, count)
    )
    return repeat(stone.retextured(scale=(0.05, 0.05)), matrices, rng.random((count, 2)))


def _fountain() -> tuple[Geometry, Geometry]:
    """Stone basin and bowl in the origin; water."""
    lip = np.linspace(-math.pi / 2, math.pi / 2, 12)
    rolled = np.stack([1.49 + 0.07 * np.cos(lip), 0.55 + 0.05 * np.sin(lip)], 1)
    basin = [
        (0, -0.05),
        (1.62, -0.05),
        (1.62, 0.1),
        (1.56, 0.14),
        (1.47, 0.2),
        (1.44, 0.36),
        (1.47, 0.48),
        *rolled,
        (1.34, 0.6),
        (1.32, 0.12),
        (0, 0.1),
    ]
    wave = np.linspace(0, 1, 40)
    stem = np.stack([0.2 - 0.1 * wave + 0.05 * np.sin(wave * 9) * (1 - wave), 0.1 + 1.05 * wave], 1)
    under = np.linspace(0, math.pi / 2, 14)
    bowl = np.stack([0.1 + 0.56 * np.sin(under), 1.15 + 0.24 * (1 - np.cos(under))], 1)
    upper = np.linspace(0, 1, 20)
    spout = np.stack([0.1 - 0.05 * upper + 0.03 * np.sin(upper * 8), 1.26 + 0.42 * upper], 1)
    finial = [
        (0, 0.08),
        *stem,
        *bowl[1:],
        (0.69, 1.4),
        (0.7, 1.42),
        (0.68, 1.43),
        (0.63, 1.4),
        (0.3, 1.29),
        *spout,
        (0.03, 1.7),
        (0, 1.72),
    ]
    stone = merge([lathe(basin, 128), lathe(finial, 96)])
    radius = np.linspace(1.335, 0.0, 40)
    ripple = 0.47 + 0.005 * np.sin(34 * radius) * np.exp(-1.2 * radius)
    ripple[-1] = ripple[-2]
    lower = lathe([(0, 0.3), (1.335, 0.3), *np.stack([radius, ripple], 1)], 128, crease=math.radians(60))
    high = lathe([(0, 1.33), (0.6, 1.37), (0.62, 1.39), (0.3, 1.392), (0, 1.393)], 96, crease=math.radians(60))
    jets = []
    for k in range(6):
        heading = k * math.pi / 3 + 0.3
        s = np.linspace(0, 1, 14)
        out = 0.64 + 0.34 * s
        fall = 1.41 + 0.12 * s - 1.05 * s**2
        jets.append(tube(np.stack([out * math.cos(heading), fall, out * math.sin(heading)], 1), 0.012 + 0.008 * s, 10))
    return stone, merge([lower, high, *jets])


def _table() -> Geometry:
    """A round café table, 0.74 m high."""
    top = [(0, 0.715), (0.32, 0.715), (0.385, 0.722), (0.39, 0.731), (0.385, 0.74), (0, 0.74)]
    turned = np.linspace(0, 1, 40)
    post = np.stack([0.028 + 0.012 * np.cos(turned * 20) * np.exp(-2 * turned), 0.12 + 0.595 * turned], 1)
    feet = []
    for k in range(3):
        line = smooth_path([(0.0, 0.16, 0), (0.1, 0.17, 0), (0.22, 0.07, 0), (0.3, 0.012, 0), (0.33, 0.02, 0)], 8)
        feet.append(tube(line, np.linspace(0.02, 0.012, len(line)), 12).placed(rotation("y", k * 2 * math.pi / 3)))
    return merge([lathe(top, 96), lathe([(0, 0.12), *post, (0, 0.715)], 32), *feet])


def _chair() -> Geometry:
    """A wrought-iron garden chair with scrolled back that faces −Z."""
    parts = [lathe([(0, 0.44), (0.17, 0.44), (0.2, 0.447), (0.2, 0.458), (0.17, 0.465), (0, 0.46)], 56)]
    for x, z in ((-0.14, -0.13), (0.14, -0.13)):
        parts.append(
            tube(smooth_path([(x, 0.445, z), (x * 1.1, 0.25, z * 1.1), (x * 1.35, 0.01, z * 1.4)], 12), 0.009, 12)
        )
    for side in (-1, 1):
        line = [
            (side * 0.2, 0.01, 0.24),
            (side * 0.16, 0.25, 0.17),
            (side * 0.16, 0.46, 0.16),
            (side * 0.19, 0.7, 0.2),
            (side * 0.12, 0.9, 0.245),
            (0, 0.95, 0.255),
        ]
        parts.append(tube(smooth_path(line, 12), 0.009, 12))
        s = np.linspace(0, 1, 60)
        swirl = 0.075 * (1 - 0.8 * s)
        scroll = np.stack(
            [
                side * (0.085 + swirl * np.cos(9 * s + 2)) * 0.9,
                0.7 + swirl * np.sin(9 * s + 2) * 1.4,
                0.19 + 0.04 * s * 0,
            ],
            1,
        )
        parts.append(tube(scroll, 0.006, 10))
    parts.append(tube(smooth_path([(0, 0.455, 0.17), (0, 0.7, 0.2), (0, 0.95, 0.255)], 10), 0.006, 10))
    hoop = np.linspace(0, 2 * math.pi, 64, endpoint=False)
    parts.append(tube(np.stack([0.17 * np.cos(hoop), 0.2 + 0 * hoop, 0.16 * np.sin(hoop)], 1), 0.006, 10, closed=True))
    return merge(parts)


def _lantern() -> tuple[Geometry, Geometry]:
    """A hexagonal lantern on a chain, hanging from the origin; iron and glass."""
    iron = []
    for k in range(9):
        hoop = np.linspace(0, 2 * math.pi, 20, endpoint=False)
        link = np.stack([0.012 * np.cos(hoop), 0.024 * np.sin(hoop), 0 * hoop], 1)
        iron.append(tube(link, 0.0035, 8, closed=True).at(0, -0.03 - 0.038 * k, 0, k * math.pi / 2))
    iron.append(
        lathe(
            [(0, -0.52), (0.13, -0.52), (0.135, -0.51), (0.06, -0.44), (0.02, -0.38), (0.02, -0.36), (0, -0.355)],
            6,
            crease=0.2,
        )
    )
    iron.append(lathe([(0, -0.84), (0.07, -0.84), (0.095, -0.82), (0.095, -0.8), (0, -0.8)], 6, crease=0.2))
    for k in range(6):
        a = k * math.pi / 3
        iron.append(
            tube(
                [(0.125 * math.cos(a), -0.515, 0.125 * math.sin(a)), (0.09 * math.cos(a), -0.81, 0.09 * math.sin(a))],
                0.007,
                8,
            )
        )
    return merge(iron), lathe([(0, -0.79), (0.08, -0.79), (0.115, -0.53), (0, -0.53)], 6, crease=0.2)


# --- assembly -----------------------------------------------------------------------------------------------------


def _ring_of_places(rows: list[tuple[float, float]], height: float) -> Matrix:
    """(lateral, distance from the axis) pairs, repeated on the four sides."""
    return np.array([side @ translation(x, height, -r) for side in SIDES for x, r in rows])


def _model(seed: int) -> _Model:
    rng = np.random.default_rng(seed)
    model = _Model()
    sides = np.array(SIDES)
    model.add("ground", cuboid((-OUTER - WALL, -0.3, -OUTER - WALL), (OUTER + WALL, 0.0, OUTER + WALL)))
    model.add("cobbles", _cobbles(rng))
    model.add("arcade floor", _arcade_floor(), sides)
    model.add("arcade", _arcade(), sides)
    model.add("column", _column(), _ring_of_places([(-6.0 + BAY * k, COURT) for k in range(BAYS)], FLOOR))
    tiles, timber = _roof(rng)
    model.add("roof tiles", tiles, sides)
    model.add("timber", timber, sides)
    wall, doors = _outer_wall()
    model.add("outer wall", wall, sides)
    model.add("doors", doors, sides)
    stone, water = _fountain()
    model.add("fountain", stone)
    model.add("water", water)

    planter = lathe(
        [(0, -0.05), (0.92, -0.05), (0.92, 0.22), (0.9, 0.26), (0.76, 0.26), (0.74, 0.22), (0.74, 0.16), (0, 0.2)], 72
    )
    model.add("planter", planter, np.array([translation(x, 0, z) for x, z, _ in TREES]))
    leaves = []
    wood = []
    for x, z, turn in TREES:
        branches, tips = _tree(rng)
        matrix = translation(x, 0.15, z) @ rotation("y", turn)
        wood.append(branches.placed(matrix))
        leaves.append(_crown_leaves(rng, (tips @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32), CROWN_LEAVES))
    model.add("trunks", merge(wood))
    leaves.append(_ivy(rng, IVY_LEAVES))
    model.add("foliage", merge(leaves))

    spots = [(-4.8, 5.35), (-2.4, 5.4), (2.4, 5.4), (4.8, 5.35), (-6.9, 8.3), (-3.5, 8.45), (3.5, 8.45)]
    heights = np.array([0.0 if r < COURT else FLOOR for _, r in spots] * 4)
    places = _ring_of_places(spots, 0.0)
    places[:, 1, 3] = heights
    turned = np.array(
        [p @ rotation("y", t) for p, t in zip(places, rng.random(len(places)) * 2 * math.pi, strict=True)]
    )
    bushy = np.arange(len(places)) % 7 < 4
    model.add("pot", _pot(0.3, 0.5), places[bushy])
    model.add("shrub", _shrub(rng, 26_000), turned[bushy] @ translation(0, 0.78, 0))
    model.add("small pot", _pot(0.24, 0.36), places[~bushy])
    model.add("fern", _sprays(rng, 90, 0.75, 0.9), turned[~bushy] @ translation(0, 0.33, 0))

    hanging = []
    for side, x in ((0, -3.6), (0, 3.4), (1, 1.0), (2, -2.4), (3, -1.2), (3, 3.8)):
        for _ in range(9):
            offset = rng.normal(0, 1, 3) * (0.55, 0.08, 0.12)
            hanging.append(
                SIDES[side]
                @ translation(x + offset[0], 4.32 + offset[1], -COURT + 0.42 + offset[2])
                @ rotation("y", rng.random() * 6.3)
            )
    model.add("bougainvillea", _sprays(rng, 70, 0.55, 1.5), np.array(hanging))

    tables = ((-3.9, 3.3), (-1.9, 4.6), (4.4, -3.4), (2.3, -4.4))
    model.add("table", _table(), np.array([translation(x, 0.02, z) for x, z in tables]))
    seats = []
    for x, z in tables:
        first = rng.random() * 2 * math.pi
        for k in range(3):
            a = first + k * 2.1 + rng.normal(0, 0.15)
            seats.append(
                translation(x + 0.62 * math.sin(a), 0.02, z + 0.62 * math.cos(a))
                @ rotation("y", a + rng.normal(0, 0.25))
            )
    model.add("chair", _chair(), np.array(seats))
    iron, glass = _lantern()
    hooks = _ring_of_places([(BAY * (k - 2), COURT + 1.3) for k in range(BAYS)], 4.55)
    model.add("lantern", iron, hooks)
    model.add("lantern glass", glass, hooks)
    fallen = 9000
    spot = np.stack([rng.normal(0, 3.2, fallen), np.full(fallen, 0.035), rng.normal(0, 3.2, fallen)], 1)
    spot[:, [0, 2]] = np.clip(spot[:, [0, 2]], -5.6, 5.6)
    up = 0.35 * _normal(rng, fallen) + _vector(0, 1, 0)
    model.add(
        "fallen leaves",
        _leaves(rng, spot, _normal(rng, fallen) * _vector(1, 0.1, 1), up, 0.045 + 0.03 * rng.random(fallen), 16),
    )
    missing = TRIANGLES - model.triangle_count
    model.add("grass", _grass(rng, missing))
    return model


_FIELDS = ("positions", "normals", "uvs", "indices")


def _arrays(seed: int) -> dict[str, NDArray[np.generic]]:
    model = _model(seed)
    arrays: dict[str, NDArray[np.generic]] = {}
    for name, part in model.parts.items():
        for attribute in _FIELDS:
            arrays[f"{name}.{attribute}"] = getattr(part, attribute)
        arrays[f"{name}.places"] = model.places[name]
    return arrays


def _materials(rng: Rng) -> dict[str, Material]:
    """A material for each part of :func:`_model`."""

    def textured(name: str, texture: Texture, roughness: float, **changes: object) -> Material:
        return Material(name, base_color=(1, 1, 1, 1), roughness=roughness, base_color_texture=texture, **changes)  # type: ignore[arg-type]

    plaster = textured(
        "plaster", textures.mottled(rng, "plaster", (0.80, 0.60, 0.40), (0.90, 0.74, 0.54), beta=2.4, metres=3.0), 0.95
    )
    ochre = textured(
        "ochre", textures.mottled(rng, "ochre", (0.70, 0.38, 0.24), (0.82, 0.52, 0.35), beta=2.4, metres=3.0), 0.95
    )
    stone = textured("stone", textures.mottled(rng, "stone", (0.58, 0.53, 0.46), (0.76, 0.71, 0.63), beta=1.7), 0.8)
    cobble = textured(
        "cobbles", textures.mottled(rng, "cobbles", (0.36, 0.34, 0.32), (0.62, 0.57, 0.51), beta=1.2), 0.75
    )
    earth = textured("earth", textures.mottled(rng, "earth", (0.28, 0.22, 0.17), (0.42, 0.34, 0.26), beta=1.5), 1.0)
    paving = textured(
        "paving",
        textures.paving(
            rng, "paving", (0.52, 0.28, 0.19), (0.70, 0.42, 0.29), (0.48, 0.42, 0.36), across=6, metres=1.8
        ),
        0.6,
    )
    tiles = textured(
        "roof tiles",
        textures.swatches(
            rng, "roof tiles", [(0.62, 0.31, 0.20), (0.72, 0.42, 0.28), (0.55, 0.30, 0.22)], shades=8, spread=0.16
        ),
        0.85,
    )
    terracotta = textured(
        "terracotta", textures.mottled(rng, "terracotta", (0.60, 0.31, 0.20), (0.74, 0.44, 0.30), metres=0.6), 0.85
    )
    timber = textured("timber", textures.wood(rng, "timber", (0.26, 0.17, 0.10), (0.40, 0.27, 0.17)), 0.7)
    door = textured("doors", textures.wood(rng, "doors", (0.16, 0.29, 0.30), (0.24, 0.38, 0.39)), 0.6)
    bark = textured(
        "bark", textures.mottled(rng, "bark", (0.25, 0.20, 0.15), (0.45, 0.38, 0.30), beta=1.1, metres=0.6), 0.95
    )
    greens = [(0.22, 0.36, 0.10), (0.32, 0.46, 0.14), (0.42, 0.54, 0.18), (0.27, 0.42, 0.16)]
    foliage = textured("foliage", textures.swatches(rng, "foliage", greens), 0.6, double_sided=True)
    box_tree = [(0.14, 0.28, 0.10), (0.20, 0.35, 0.13), (0.26, 0.40, 0.16), (0.17, 0.31, 0.14)]
    shrub = textured("shrub", textures.swatches(rng, "shrub", box_tree), 0.55, double_sided=True)
    dry = [(0.60, 0.42, 0.16), (0.50, 0.28, 0.12), (0.66, 0.52, 0.22), (0.40, 0.34, 0.14)]
    fallen = textured("fallen leaves", textures.swatches(rng, "fallen leaves", dry), 0.8, double_sided=True)
    blade = [(0.30, 0.42, 0.14), (0.40, 0.48, 0.18), (0.24, 0.36, 0.12), (0.48, 0.48, 0.22)]
    grass = textured("grass", textures.swatches(rng, "grass", blade), 0.8, double_sided=True)
    fern = textured(
        "fern",
        textures.leaf_spray(rng, "fern", (0.13, 0.28, 0.09), (0.36, 0.52, 0.18), leaves=17),
        0.55,
        alpha_mode="mask",
        double_sided=True,
    )
    flower = textured(
        "bougainvillea",
        textures.leaf_spray(rng, "bougainvillea", (0.62, 0.08, 0.34), (0.90, 0.30, 0.56), leaves=13),
        0.7,
        alpha_mode="mask",
        double_sided=True,
    )
    iron = Material("iron", base_color=(0.035, 0.045, 0.045, 1), roughness=0.45)
    water = Material("water", base_color=(0.10, 0.22, 0.22, 1), roughness=0.08)
    glass = Material("lantern glass", base_color=(0.9, 0.75, 0.5, 1), roughness=0.3, emissive=(0.8, 0.5, 0.22))
    return {
        "ground": earth, "cobbles": cobble, "arcade floor": paving, "arcade": plaster, "column": stone,
        "roof tiles": tiles, "timber": timber, "outer wall": ochre, "doors": door, "fountain": stone, "planter": stone,
        "water": water, "trunks": bark, "foliage": foliage, "pot": terracotta, "small pot": terracotta, "shrub": shrub,
        "fern": fern, "bougainvillea": flower, "table": iron, "chair": iron, "lantern": iron, "lantern glass": glass,
        "fallen leaves": fallen, "grass": grass,
    }  # fmt: skip


def courtyard(lights: int = 1, seed: int = 0) -> Scene:
    """An arcaded patio with a fountain: the sun falls through the foliage of two trees.

    Args:
        lights: 1 to 32 directional lights.
        seed: of plants, textures and furniture. Each seed is modelled once and kept on disk, some 250 MB.

    Raises:
        ParameterError: ``lights`` or ``seed`` is not a whole number in range.
    """
    options = Options(lights, seed)
    version = cache.version_of((__file__, Path(primitives.__file__)))
    arrays = cache.cached("courtyard", version, str(options.seed), lambda: _arrays(options.seed))
    materials = _materials(np.random.default_rng((options.seed, 1)))
    instances = []
    for name, material in materials.items():
        part = Geometry(*(arrays[f"{name}.{attribute}"] for attribute in _FIELDS))
        mesh = part.mesh(material, name)
        instances += [Instance(mesh, matrix, name) for matrix in arrays[f"{name}.places"]]
    return Scene(
        instances=tuple(instances),
        lights=suns(options.lights, SUN, 4.0, (1.0, 0.92, 0.78), (38, 75)),
        camera=Camera((-4.5, 1.5, 5.3), (0.1, 1.95, -0.8), fov=math.radians(62), exposure=1.7),
        medium=Medium((0.045,) * 3, (0.002,) * 3, HenyeyGreenstein(0.25), ((-10.0, -0.3, -10.0), (10.0, 8.5, 10.0))),
        background=(0.55, 0.8, 1.25),
        ambient=(0.24, 0.27, 0.33),
        looks={
            "screen_space": {"exposure": 1.0, "decay": 0.94, "weight": 0.01},
            "polygonal": {"g": 0.0, "tau": 3.99e-5},
            "froxel": {"g": 0.25, "z_limit": 40.0, "density": 0.02, "c_s": 2.0},
        },
        name="courtyard",
    )
