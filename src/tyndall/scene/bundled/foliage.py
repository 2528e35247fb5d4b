"""`foliage`: a lemon tree in a pot and a vine on a whitewashed wall, in dappled sun.

The hard case of alpha-masked casters: leaves are cut out of a texture on folded cards, are lit from both sides, and
cast their shadows on each other and, over distances up to 3 m, on the wall and the paving. A technique that sees
triangles only casts the shadows of the cards. With two lights or more, a spot light shines across the leaves from the
right; the others are suns.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tyndall.scene.bundled import textures
from tyndall.scene.bundled.primitives import Floats, Geometry, cuboid, lathe, merge, rounded_box, smooth_path, tube
from tyndall.scene.bundled.sunlight import Options, suns
from tyndall.scene.model import Camera, Instance, Light, Material, Scene, SpotLight, Vec3

TRIANGLES = 22_334

SUN: Vec3 = (0.62, -0.62, -0.62)
SUN_DIAMETER = 0.0093
LAMP: Vec3 = (3.4, 2.3, 3.0)
ILLUMINANCE = 9.0


def _cards(roots: Floats, heading: Floats, up: Floats, length: Floats) -> Geometry:
    """Cards of four triangles folded along their stems: (N, 3) roots, headings and upper sides, (N,) lengths.

    A texture covers each once, its stem from v = 1 at the root to v = 0 at the tip.
    """
    along = heading / np.linalg.norm(heading, axis=1, keepdims=True)
    side = np.cross(along, up)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    face = np.cross(side, along)
    size = length[:, None]
    count = len(roots)
    rows = []
    for v in (0.0, 1.0):
        droop = face * (-0.12 * v * size)
        for s in (-0.5, 0.0, 0.5):
            rows.append(roots + along * (v * size) + side * (s * 0.9 * size) + face * (0.16 * abs(s) * size) + droop)
    positions = np.stack(rows, 1)
    tilt = np.array((0.16, 0.0, -0.16))  # normals lean towards the fold
    normals = face[:, None] - np.tile(tilt, 2)[None, :, None] * -side[:, None]
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    uvs = np.array([(0, 1), (0.5, 1), (1, 1), (0, 0), (0.5, 0), (1, 0)], np.float32)
    quads = np.array([(0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4)], np.uint32)
    indices = np.arange(count, dtype=np.uint32)[:, None, None] * np.uint32(6) + quads
    return Geometry(
        positions.reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        np.tile(uvs, (count, 1)),
        indices.reshape(-1, 3),
    )


def _along(rng: np.random.Generator, path: Floats, count: int, start: float) -> tuple[Floats, Floats]:
    """Random places on the part of a path behind ``start`` (0..1), and its direction there; (count, 3) each."""
    at = np.sort(start + (1 - start) * rng.random(count)) * (len(path) - 1)
    index = np.minimum(at.astype(int), len(path) - 2)
    fraction = (at - index)[:, None]
    step = path[index + 1] - path[index]
    return path[index] + fraction * step, step / np.linalg.norm(step, axis=1, keepdims=True)


def _bend(rng: np.random.Generator, start: Floats, heading: Floats, length: float, lift: float) -> Floats:
    points = [start]
    for _ in range(4):
        heading = heading + rng.normal(0, 0.16, 3) + np.array((0, lift, 0))
        heading = heading / np.linalg.norm(heading)
        points.append(points[-1] + heading * length / 4)
    return smooth_path(np.array(points), 4)


def _tree(rng: np.random.Generator, x: float, z: float, foot: float) -> tuple[Geometry, Geometry, Floats]:
    """Wood, leaves, and the places of fruit of a small tree."""
    trunk = smooth_path(
        [(0, foot, 0), (0.03, foot + 0.3, 0.01), (-0.02, foot + 0.65, 0), (0.02, foot + 0.95, -0.02)], 6
    )
    wood, roots, headings = [tube(trunk, np.linspace(0.034, 0.024, len(trunk)), 12)], [], []
    for k in range(9):
        turn = 2.4 * k
        out = np.array((math.cos(turn), 0.45 + 0.12 * k, math.sin(turn)))
        branch = _bend(rng, trunk[-1 - (k % 4)], out / np.linalg.norm(out), 0.62 + 0.16 * rng.random(), 0.08)
        wood.append(tube(branch, np.linspace(0.014, 0.006, len(branch)), 7))
        for _ in range(4):
            (root,), (heading,) = _along(rng, branch, 1, 0.35)
            aim = heading + rng.normal(0, 0.6, 3)
            twig = _bend(rng, root, aim / np.linalg.norm(aim), 0.34, 0.0)
            wood.append(tube(twig, np.linspace(0.006, 0.003, len(twig)), 5))
            place, direction = _along(rng, twig, 15, 0.1)
            roots.append(place)
            headings.append(direction + rng.normal(0, 0.75, direction.shape))
    root, heading = np.concatenate(roots), np.concatenate(headings)
    centre = np.array((0, foot + 1.25, 0))
    up = (root - centre) + rng.normal(0, 0.25, root.shape) + (0, 0.45, 0)
    leaves = _cards(root, heading, up, rng.uniform(0.15, 0.24, len(root)))
    fruit = root[rng.permutation(len(root))[:9]] - (0, 0.07, 0)
    return merge(wood).at(x, 0, z), leaves.at(x, 0, z), fruit + (x, 0, z)


def _vine(rng: np.random.Generator) -> tuple[Geometry, Geometry]:
    """A vine that climbs the wall on the right and hangs into the picture from above: wood and leaves."""
    stems = [
        [(2.35, 0.0, 0.06), (2.3, 0.8, 0.05), (2.42, 1.6, 0.06), (2.2, 2.4, 0.05), (1.7, 2.85, 0.06), (0.9, 3.0, 0.07),
         (0.1, 2.9, 0.06)],
        [(2.42, 1.6, 0.06), (1.95, 1.95, 0.05), (1.55, 2.1, 0.06), (1.2, 2.0, 0.08)],
        [(2.3, 0.8, 0.05), (2.7, 1.3, 0.06), (2.85, 2.0, 0.06), (2.75, 2.7, 0.06)],
        [(0.9, 3.0, 0.07), (0.6, 2.7, 0.09), (0.5, 2.35, 0.1), (0.52, 2.0, 0.12)],
    ]  # fmt: skip
    wood, roots, headings = [], [], []
    for stem, count in zip(stems, (150, 60, 70, 45), strict=True):
        path = smooth_path(np.array(stem), 10)
        wood.append(tube(path, np.linspace(0.018, 0.006, len(path)), 7))
        place, direction = _along(rng, path, count, 0.08)
        roots.append(place + rng.normal(0, 0.03, place.shape) * (1, 1, 0))
        headings.append(0.4 * direction + rng.normal(0, 0.7, direction.shape) * (1, 1, 0.4) + (0, -0.35, 0.35))
    root, heading = np.concatenate(roots), np.concatenate(headings)
    root[:, 2] = np.maximum(root[:, 2], 0.03)
    up = rng.normal(0, 0.3, root.shape) + (0, 0.35, 1.0)
    return merge(wood), _cards(root, heading, up, rng.uniform(0.15, 0.25, len(root)))


def _bough(rng: np.random.Generator) -> tuple[Geometry, Geometry]:
    """A bough of a larger tree that reaches in from the upper left, 1 to 2 m before the wall."""
    path = smooth_path(
        [
            (-6.0, 3.2, 2.2),
            (-3.8, 3.05, 2.0),
            (-2.4, 2.98, 1.7),
            (-1.2, 2.8, 1.5),
            (-0.2, 2.64, 1.4),
            (0.5, 2.45, 1.35),
        ],
        8,
    )
    wood, roots, headings = [tube(path, np.linspace(0.05, 0.012, len(path)), 10)], [], []
    for _ in range(16):
        (root,), (heading,) = _along(rng, path, 1, 0.42)
        aim = heading + rng.normal(0, 0.7, 3) - (0, 0.05, 0)
        branch = _bend(rng, root, aim / np.linalg.norm(aim), 0.62, -0.02)
        wood.append(tube(branch, np.linspace(0.011, 0.004, len(branch)), 6))
        place, direction = _along(rng, branch, 22, 0.12)
        roots.append(place)
        headings.append(direction + rng.normal(0, 0.6, direction.shape))
    root, heading = np.concatenate(roots), np.concatenate(headings)
    up = rng.normal(0, 0.4, root.shape) + (0, 1.0, 0)
    return merge(wood), _cards(root, heading, up, rng.uniform(0.18, 0.29, len(root)))


def _lights(count: int) -> tuple[Light, ...]:
    bundle = suns(count, SUN, ILLUMINANCE, (1.0, 0.92, 0.80), (34, 62), spread=120)
    lights: list[Light] = [replace(light, angular_diameter=SUN_DIAMETER) for light in bundle]
    if count > 1:
        towards = np.array((0.0, 1.3, 0.2)) - LAMP
        x, y, z = (float(v) for v in towards)
        candela = bundle[1].intensity * float(towards @ towards)
        lights[1] = SpotLight(LAMP, (x, y, z), candela, (1.0, 0.72, 0.45), 0.35, 0.6, radius=0.04)
    return tuple(lights)


def foliage(lights: int = 1, seed: int = 0) -> Scene:
    """A lemon tree, a vine and a bough before a white wall: leaves cut out by alpha, and their dappled shade.

    Args:
        lights: 1 to 32: the sun, a spot light, and further suns.
        seed: of leaves, branches and textures.

    Raises:
        ParameterError: ``lights`` or ``seed`` is not a whole number in range.
    """
    options = Options(lights, seed)
    rng = np.random.default_rng(options.seed)

    def leafy(name: str, low: Vec3, high: Vec3, leaves: int) -> Material:
        spray = textures.leaf_spray(rng, name, low, high, leaves=leaves)
        return Material(
            name, (1, 1, 1, 1), roughness=0.65, base_color_texture=spray, alpha_mode="mask", double_sided=True
        )

    lemon = leafy("lemon leaves", (0.17, 0.40, 0.13), (0.48, 0.68, 0.26), 7)
    ivy = leafy("vine leaves", (0.20, 0.32, 0.10), (0.56, 0.62, 0.22), 5)
    oak = leafy("bough leaves", (0.24, 0.38, 0.16), (0.58, 0.64, 0.30), 9)
    plaster = Material(
        "whitewash", roughness=0.95, base_color=(1, 1, 1, 1),
        base_color_texture=textures.mottled(
            rng, "whitewash", (0.84, 0.80, 0.74), (0.95, 0.93, 0.89), beta=2.0, metres=3.0
        ),
    )  # fmt: skip
    paving = Material(
        "paving", roughness=0.85, base_color=(1, 1, 1, 1),
        base_color_texture=textures.paving(
            rng, "terracotta", (0.60, 0.38, 0.28), (0.74, 0.52, 0.40), (0.42, 0.34, 0.28), across=6, metres=1.8
        ),
    )  # fmt: skip
    clay = Material("clay", (0.58, 0.26, 0.15, 1), roughness=0.8)
    bark = Material("bark", (0.22, 0.15, 0.10, 1), roughness=0.9)
    peel = Material("lemons", (0.90, 0.66, 0.05, 1), roughness=0.4)
    paint = Material("bench", (0.10, 0.25, 0.31, 1), roughness=0.5)

    tree_wood, tree_leaves, places = _tree(rng, -1.3, 0.95, 0.42)
    vine_wood, vine_leaves = _vine(rng)
    bough_wood, bough_leaves = _bough(rng)
    pot = lathe(
        [(0, 0), (0.19, 0), (0.215, 0.03), (0.27, 0.40), (0.305, 0.41), (0.31, 0.49), (0.29, 0.50), (0.265, 0.49),
         (0.25, 0.43), (0, 0.42)], 36
    )  # fmt: skip
    lemon_shape = lathe(
        [(0, -0.052), (0.012, -0.045), (0.030, -0.026), (0.036, 0), (0.030, 0.026), (0.012, 0.042), (0, 0.046)], 14, 3.0
    )  # fmt: skip
    fruit = merge([lemon_shape.at(*(float(v) for v in place)) for place in places])
    seat = [rounded_box((0.55, 0.40, z), (1.85, 0.435, z + 0.105), 0.008) for z in (0.28, 0.40, 0.52)]
    seat += [rounded_box((x, 0, 0.32), (x + 0.06, 0.41, 0.59), 0.008) for x in (0.68, 1.66)]
    ledge = rounded_box((-3.6, 0.0, -0.02), (3.6, 0.12, 0.03), 0.008)
    parts = {
        "ground": (cuboid((-4.5, -0.2, -0.3), (4.5, 0, 5.5)), paving),
        "wall": (merge([cuboid((-4.5, 0, -0.3), (4.5, 3.7, 0)), ledge]), plaster),
        "pot": (pot.at(-1.3, 0, 0.95), clay),
        "bench": (merge(seat), paint),
        "lemons": (fruit, peel),
        "wood": (merge([tree_wood, vine_wood, bough_wood]), bark),
        "tree leaves": (tree_leaves, lemon),
        "vine leaves": (vine_leaves, ivy),
        "bough leaves": (bough_leaves, oak),
    }
    return Scene(
        instances=tuple(Instance(part.mesh(material, name), name=name) for name, (part, material) in parts.items()),
        lights=_lights(options.lights),
        camera=Camera((0.35, 1.55, 5.3), (0.15, 1.38, 0.0), fov=math.radians(36), exposure=-0.3),
        background=(0.45, 0.62, 0.9),
        ambient=(0.28, 0.33, 0.42),
        name="foliage",
    )
