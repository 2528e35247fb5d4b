"""`blinds`: a classroom in the late afternoon; the sun falls through Venetian blinds in thin slanted sheets.

Room: 7 m wide (x; the windows are in the wall x = 0), 3.2 m high, 7.5 m long (z; the blackboard hangs on the wall
z = 0). Three windows with 23 slats each, the middle blind half raised. The sun stands 31° high and shines a little
towards the camera, into the lobe of a forward-scattering medium. 607,402 triangles.
"""

from __future__ import annotations

import math

import numpy as np

from tyndall.scene.bundled import textures
from tyndall.scene.bundled.primitives import (
    Floats,
    Geometry,
    Matrix,
    ball,
    cuboid,
    flat,
    lathe,
    merge,
    pierced_wall,
    placements,
    plate,
    refine,
    repeat,
    ribbon_solid,
    rotation,
    rounded_box,
    smooth_path,
    translation,
    tube,
)
from tyndall.scene.bundled.sunlight import Options, suns
from tyndall.scene.model import Camera, HenyeyGreenstein, Instance, Material, Medium, Mesh, Scene, Texture, Vec3

TRIANGLES = 607_402

WIDTH, HEIGHT, LENGTH, WALL = 7.0, 3.2, 7.5, 0.3
SILL, HEAD = 0.95, 2.85
WINDOWS = ((0.5, 2.4), (2.9, 4.8), (5.3, 7.2))  # z from, z to
SLATS, SLAT_PITCH, SLAT_DEPTH = 23, 0.078, 0.06
SUN: Vec3 = (0.70, -0.50, 0.42)
COLUMNS, ROWS = (1.35, 2.75, 4.15, 5.55), (2.55, 3.75, 4.95, 6.15)  # x and z of the pupils' desks


def _shell() -> dict[str, Geometry]:
    """Floor, ceiling and walls. Walls have two leaves (see :mod:`~tyndall.scene.bundled.box`)."""
    half = WALL / 2
    low, high = -half, HEIGHT + half
    span = LENGTH + 2 * WALL
    holes = [(LENGTH + WALL - far, SILL - low, LENGTH + WALL - near, HEAD - low) for near, far in WINDOWS]
    recess = [(a - 0.05, b - 0.05, c + 0.05, d + 0.05) for a, b, c, d in holes]
    upright = translation(-WALL, low, LENGTH + WALL) @ rotation("y", math.pi / 2)
    walls = [
        pierced_wall((span, high - low), half, opening).placed(upright @ translation(0, 0, offset))
        for opening, offset in ((recess, 0.0), (holes, half))
    ]
    for near, far in ((0.0, half), (half, WALL)):
        walls += [
            cuboid((WIDTH + near, low, -WALL), (WIDTH + far, high, LENGTH + WALL)),
            cuboid((-WALL, low, -far), (WIDTH + WALL, high, -near)),
            cuboid((-WALL, low, LENGTH + near), (WIDTH + WALL, high, LENGTH + far)),
        ]
    ceiling = [
        cuboid((-WALL, HEIGHT + near, -WALL), (WIDTH + WALL, HEIGHT + far, LENGTH + WALL))
        for near, far in ((0.0, half), (half, WALL))
    ]
    beams = [rounded_box((0.0, HEIGHT - 0.16, z - 0.1), (WIDTH, HEIGHT + 0.05, z + 0.1), 0.015) for z in (2.65, 5.05)]
    boards = np.arange(0.06, LENGTH - 0.05, 0.12)
    board = rounded_box((-0.012, 0.1, -0.0601), (0.012, 1.05, 0.0601), 0.006)
    right = repeat(
        board, placements(np.stack([np.full(len(boards), WIDTH - 0.012), 0 * boards, boards], 1), 0 * boards)
    )
    across = np.arange(0.06, WIDTH - 0.05, 0.12)
    front = repeat(
        board,
        placements(np.stack([across, 0 * across, np.full(len(across), 0.012)], 1), np.full(len(across), -math.pi / 2)),
    )
    rails = [
        rounded_box((WIDTH - 0.045, 1.04, 0), (WIDTH + 0.01, 1.09, LENGTH), 0.01),
        rounded_box((WIDTH - 0.035, -0.01, 0), (WIDTH + 0.01, 0.12, LENGTH), 0.01),
        rounded_box((0, 1.04, -0.01), (WIDTH, 1.09, 0.045), 0.01),
        rounded_box((0, -0.01, -0.01), (WIDTH, 0.12, 0.035), 0.01),
        rounded_box((-0.01, -0.01, 0), (0.03, 0.12, LENGTH), 0.01),
    ]
    return {
        "floor": cuboid((-WALL, -WALL, -WALL), (WIDTH + WALL, 0, LENGTH + WALL)),
        "walls": merge(walls),
        "ceiling": merge([*ceiling, *beams]),
        "panelling": merge([right, front, *rails]),
    }


def _window_frame(width: float) -> Geometry:
    """Casement with two mullions and a transom, in the plane x = −0.2, from z = 0 to ``width``; and the inner sill."""
    x0, x1, bar = -0.22, -0.17, 0.05
    height = HEAD - SILL
    parts = [
        rounded_box((x0, SILL, z), (x1, HEAD, z + bar), 0.008)
        for z in (0.0, (width - bar) / 3, 2 * (width - bar) / 3, width - bar)
    ]
    parts += [rounded_box((x0, y, 0), (x1, y + bar, width), 0.008) for y in (SILL, SILL + 0.68 * height, HEAD - bar)]
    parts.append(rounded_box((-0.16, SILL - 0.035, -0.06), (0.1, SILL + 0.012, width + 0.06), 0.012, 2))
    return merge(parts)


def _blind(width: float, raised: float) -> Geometry:
    """A Venetian blind in the plane x = −0.06, from z = 0 to ``width``; its slats hang ``raised`` (0..1) of the way up.

    A slat is a curved aluminium strip, sagging by a millimetre between its cords.
    """
    z = np.linspace(width - 0.02, 0.02, 41)[:, None]
    t = np.linspace(-1, 1, 6)[None]
    sag = 0.001 * np.sin(z / width * 3 * math.pi) ** 2
    slat = plate(np.stack([SLAT_DEPTH / 2 * t + 0 * z, 0.006 * (1 - t**2) - sag, z + 0 * t], -1), 0.002)
    top = HEAD - 0.09
    hanging = max(1, round(SLATS * (1 - raised)))
    heights = top - SLAT_PITCH * np.arange(hanging)
    stacked = heights[-1] - SLAT_PITCH - 0.009 * np.arange(SLATS - hanging)
    level = np.concatenate([heights, stacked])
    where = np.stack([np.full(SLATS, -0.06), level, np.zeros(SLATS)], 1)
    # Slats tilt about their length, along Z: build the rotations here, with a slight unevenness from slat to slat.
    tilt = np.where(np.arange(SLATS) < hanging, 0.1 + 0.02 * np.sin(7.0 * np.arange(SLATS)), 0.0)
    matrices = np.tile(np.eye(4), (SLATS, 1, 1))
    matrices[:, 0, 0] = matrices[:, 1, 1] = np.cos(tilt)
    matrices[:, 0, 1], matrices[:, 1, 0] = -np.sin(tilt), np.sin(tilt)
    matrices[:, :3, 3] = where
    foot = float(level[-1]) - 0.03
    parts = [
        repeat(slat, matrices),
        rounded_box((-0.095, HEAD - 0.05, 0.01), (-0.025, HEAD - 0.005, width - 0.01), 0.008, 2),
        rounded_box((-0.09, foot - 0.01, 0.015), (-0.03, foot + 0.008, width - 0.015), 0.008, 2),
    ]
    for at in (1 / 6, 0.5, 5 / 6):
        for x_cord in (-0.06 - SLAT_DEPTH / 2 - 0.002, -0.06 + SLAT_DEPTH / 2 + 0.002):
            parts.append(tube([(x_cord, foot, at * width), (x_cord, HEAD - 0.03, at * width)], 0.0016, 8))
    pull = smooth_path([(-0.02, HEAD - 0.04, 0.12), (-0.015, 2.2, 0.115), (-0.018, 1.5, 0.12), (-0.017, 1.3, 0.12)], 16)
    parts.append(tube(pull, 0.002, 8))
    parts.append(lathe([(0, 0), (0.009, 0.004), (0.008, 0.03), (0.003, 0.045), (0, 0.046)], 16).at(-0.017, 1.26, 0.12))
    return merge(parts)


def _squircle(width: float, depth: float, steps: int, corner: float = 0.25) -> tuple[Floats, Floats]:
    """Grids x, z of a rectangle with rounded corners: the square's parameter lines, bent at the corners."""
    a = np.linspace(-1, 1, steps)
    u, v = np.meshgrid(a, a)
    return width / 2 * u * np.sqrt(1 - corner * v**2 * u**2), -depth / 2 * v * np.sqrt(1 - corner * u**2 * v**2)


def _chair() -> tuple[Geometry, Geometry]:
    """Steel frame and plywood of a school chair that faces −Z, on the floor at the origin."""
    seat = 0.45
    frame = []
    for side in (-1, 1):
        x = side * 0.175
        line = [
            (x * 1.12, 0.012, -0.2), (x * 1.02, 0.25, -0.185), (x, seat - 0.07, -0.17), (x, seat - 0.02, -0.12),
            (x, seat - 0.02, 0.09), (x, seat + 0.03, 0.165), (x, 0.6, 0.185), (x, 0.84, 0.24),
        ]  # fmt: skip
        frame.append(tube(smooth_path(line, 14), 0.011, 12))
        back = [(x * 1.15, 0.012, 0.26), (x * 1.05, 0.22, 0.2), (x, seat - 0.04, 0.11)]
        frame.append(tube(smooth_path(back, 16), 0.011, 12))
        for z in (-0.2, 0.26):
            foot = lathe([(0, 0), (0.014, 0), (0.015, 0.012), (0.0135, 0.03), (0, 0.03)], 16)
            frame.append(foot.at(x * (1.12 if z < 0 else 1.15), 0, z))
    for y, z in ((seat - 0.022, -0.1), (seat - 0.022, 0.09), (0.2, 0.205)):
        frame.append(tube(np.stack([np.linspace(-0.18, 0.18, 12), np.full(12, y), np.full(12, z)], 1), 0.009, 12))
    x_grid, z_grid = _squircle(0.4, 0.4, 18)
    dish = seat - 0.012 * np.cos(x_grid / 0.4 * math.pi) + 0.03 * np.clip(z_grid / 0.2, -1, 0) ** 2 * -1
    plywood = [plate(np.stack([x_grid, dish, z_grid], -1), 0.012, (0.4, 0.4))]
    x_grid, y_grid = _squircle(0.4, 0.2, 18)
    bend = 0.225 - 0.12 * (x_grid / 0.4) ** 2 * 1.2 - 0.22 * y_grid
    plywood.append(plate(np.stack([x_grid, 0.74 - y_grid, bend], -1)[::-1], 0.011, (0.4, 0.2)))
    return merge(frame), merge(plywood)


def _desk() -> tuple[Geometry, Geometry]:
    """Steel frame and wood of a pupil's desk, 0.7 × 0.5 m, at the origin; the pupil sits on the +Z side."""
    top = 0.74
    wood = [
        rounded_box((-0.35, top - 0.025, -0.25), (0.35, top, 0.25), 0.008, 3),
        rounded_box((-0.3, top - 0.16, -0.2), (0.3, top - 0.148, 0.2), 0.004),
        rounded_box((-0.3, top - 0.16, -0.2), (0.3, top - 0.03, -0.188), 0.004),
        rounded_box((-0.3, top - 0.16, -0.2), (-0.288, top - 0.03, 0.2), 0.004),
        rounded_box((0.288, top - 0.16, -0.2), (0.3, top - 0.03, 0.2), 0.004),
    ]
    frame = []
    for side in (-1, 1):
        x = side * 0.315
        line = [
            (x, 0.014, 0.2), (x, 0.35, 0.2), (x, top - 0.095, 0.2), (x, top - 0.036, 0.14), (x, top - 0.036, -0.14),
            (x, top - 0.095, -0.2), (x, 0.35, -0.2), (x, 0.014, -0.2),
        ]  # fmt: skip
        frame.append(tube(smooth_path(line, 14), 0.013, 12))
        for z in (-0.2, 0.2):
            foot = lathe([(0, 0), (0.016, 0), (0.017, 0.012), (0.0155, 0.035), (0, 0.035)], 16)
            frame.append(foot.at(x, 0, z))
    bar = np.stack([np.linspace(-0.315, 0.315, 16), np.full(16, 0.14), np.full(16, -0.2)], 1)
    frame.append(tube(bar, 0.011, 12))
    hook = smooth_path(
        [(0.33, top - 0.03, 0.05), (0.345, top - 0.07, 0.05), (0.37, top - 0.085, 0.05), (0.38, top - 0.06, 0.05)], 8
    )
    frame.append(tube(hook, 0.004, 10))
    return merge(frame), merge(wood)


def _book() -> Geometry:
    """A closed book lying on its back cover: 1 × 1 in XZ with its spine at x = 0, 1 thick; for scaled copies.

    The texture coordinate of the cover is 0, that of the page block ½ in u (a strip of swatches follows).
    """
    angle = np.linspace(-math.pi / 2, math.pi / 2, 9)
    cover = 0.06
    outer = np.stack([0.06 - 0.06 * np.cos(angle), 0.5 + 0.5 * np.sin(angle)], 1)
    inner = np.stack([0.06 + cover - 0.06 * np.cos(angle), 0.5 + (0.5 - cover) * np.sin(angle)], 1)
    # From the edge of the lower board around the spine: the outside is to the left, as a ribbon's upper side is.
    strip = np.concatenate([[[[1, cover], [1, 0]]], np.stack([inner, outer], 1), [[[1, 1 - cover], [1, 1]]]])
    cover_part = ribbon_solid(strip, 1.0).retextured((0.0, 0.5), (0.0, 0.0))
    pages = cuboid((0.07, cover * 0.6, 0.025), (0.97, 1 - cover * 0.6, 0.975)).retextured((0.5, 0.5), (0.0, 0.0))
    return merge([cover_part, pages])


def _books(rng: np.random.Generator, matrices: Matrix) -> Geometry:
    """Copies of :func:`_book` under (N, 4, 4) matrices with any scale, each in a cover colour of its own."""
    book = _book()
    covers = rng.integers(0, 32, len(matrices)) / 64
    copies = []
    for matrix, cover in zip(matrices, covers, strict=True):
        part = book.placed(matrix)
        uvs = part.uvs.copy()
        uvs[uvs[:, 0] == 0, 0] = cover + 1 / 128
        uvs[uvs[:, 0] == 0.5, 0] = 0.5 + 1 / 128
        copies.append(Geometry(part.positions, part.normals, uvs, part.indices))
    return merge(copies)


def _shelf_and_books(rng: np.random.Generator) -> tuple[Geometry, Matrix]:
    """A bookcase against the right wall, z from 3.2 to 5.6 m, and the matrices of its books."""
    x0, x1, z0, z1, top = WIDTH - 0.36, WIDTH - 0.03, 3.2, 5.6, 1.98
    boards = [rounded_box((x0, y, z0), (x1, y + 0.028, z1), 0.004) for y in np.linspace(0.06, top - 0.028, 6)]
    boards += [
        rounded_box((x0 - 0.005, 0, z), (x1, top + 0.02, z + 0.03), 0.004) for z in (z0, (z0 + z1) / 2, z1 - 0.03)
    ]
    boards.append(rounded_box((x1 - 0.012, 0.05, z0), (x1, top, z1), 0.004))
    matrices = []
    for y in np.linspace(0.06, top - 0.028, 6)[:-1] + 0.028:
        for start, end in ((z0 + 0.03, (z0 + z1) / 2), ((z0 + z1) / 2 + 0.03, z1 - 0.03)):
            z = start
            while True:
                thick, tall, deep = rng.uniform(0.014, 0.05), rng.uniform(0.2, 0.31), rng.uniform(0.16, 0.24)
                if z + thick > end - 0.12 * rng.random():
                    break
                # Stand the book up with its spine towards the room: x → depth into the shelf, y → along z, z → up.
                stand = np.eye(4)
                stand[:3, :3] = np.array([[deep, 0, 0], [0, 0, tall], [0, -thick, 0]])
                stand[:3, 3] = x0 + 0.01 + 0.03 * rng.random(), y, z + thick
                matrices.append(stand)
                z += thick + 0.001
    return merge(boards), np.array(matrices)


def _lying_books(rng: np.random.Generator) -> Matrix:
    """Matrices of books in small stacks on the desks and the teacher's desk."""
    matrices = []
    spots = [(x, z) for x in COLUMNS for z in ROWS]
    chosen = rng.permutation(len(spots))[:13]
    stacks = [
        (spots[i][0] + rng.uniform(-0.2, 0.05), 0.74, spots[i][1] + rng.uniform(-0.15, 0.0), int(rng.integers(1, 5)))
        for i in chosen
    ]
    stacks += [(5.05, 0.78, 1.0, 6), (4.45, 0.78, 1.25, 2)]
    for x, y, z, count in stacks:
        turn = rng.uniform(-0.5, 0.5)
        for _ in range(count):
            thick, wide, long = rng.uniform(0.015, 0.045), rng.uniform(0.14, 0.2), rng.uniform(0.2, 0.27)
            size = np.diag([wide, thick, long, 1.0])
            turn += rng.uniform(-0.35, 0.35)
            matrices.append(translation(x, y, z) @ rotation("y", turn) @ translation(-wide / 2, 0, -long / 2) @ size)
            y += thick + 0.0005
    return np.array(matrices)


def _papers(rng: np.random.Generator) -> Geometry:
    """Sheets of paper on the desks and a few on the floor, a little curled."""
    copies = []
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 11), np.linspace(0.5, -0.5, 15))
    spots = [(x, 0.742, z) for x in COLUMNS for z in ROWS] + [(2.1, 0.003, 4.4), (3.4, 0.003, 3.1), (4.7, 0.782, 0.95)]
    for x, y, z in spots:
        curl, heading = rng.uniform(0.0, 0.03), rng.uniform(0, math.pi)
        lift = curl * (np.cos(heading) * u + np.sin(heading) * v + 0.3).clip(0) ** 2 * 1.6
        points = np.stack([0.21 * u, lift, 0.297 * v], -1)
        offset = rng.uniform(-0.1, 0.1, 2)
        copies.append(
            plate(points, 0.0006, (0.21, 0.297)).at(
                x + offset[0] + 0.08, y, z + offset[1] * 0.6 + 0.03, rng.normal(0, 0.25)
            )
        )
    return merge(copies)


def _pencils(rng: np.random.Generator) -> Geometry:
    """Sharpened pencils, about one on each desk."""
    profile = [(0, 0), (0.0008, 0.001), (0.0035, 0.02), (0.0037, 0.021), (0.0037, 0.165), (0.0032, 0.172), (0, 0.172)]
    pencil = lathe(profile, 12).placed(rotation("z", -math.pi / 2))
    spots = np.array([(x, 0.7445, z) for x in COLUMNS for z in ROWS])
    spots[:, [0, 2]] += rng.uniform(-0.16, 0.16, (len(spots), 2))
    turns = rng.uniform(0, 2 * math.pi, len(spots))
    uv = np.stack([(rng.integers(0, 32, len(spots)) + 0.5) / 64, np.full(len(spots), 0.5)], 1)
    return repeat(pencil.retextured(scale=(0, 0)), placements(spots, turns), uv)


def _radiator(length: float) -> Geometry:
    """A cast-iron radiator of rounded sections along z, from z = 0, against the wall x = 0."""
    pitch = 0.062
    count = int(length / pitch)
    turn = np.linspace(0, math.pi, 15)
    upper = np.stack([0.05 * np.cos(turn), 0.24 + 0.05 * np.sin(turn)], 1)
    side = np.stack([np.full(6, -0.05), np.linspace(0.24, -0.24, 8)[1:-1]], 1)
    loop = np.concatenate([upper, side, -upper, -side])
    section = tube(np.concatenate([loop, np.zeros((len(loop), 1))], 1), 0.021, 14, closed=True)
    inner = tube([(0, -0.285, 0), (0, 0, 0), (0, 0.285, 0)], 0.017, 12)
    z = pitch * (np.arange(count) + 0.5)
    where = np.stack([np.full(count, 0.12), np.full(count, 0.46), z], 1)
    pipes = [
        tube([(0.12, h, -0.06), (0.12, h, length / 2), (0.12, h, count * pitch + 0.06)], 0.016, 14)
        for h in (0.19, 0.73)
    ]
    return merge([repeat(merge([section, inner]), placements(where, 0 * z)), *pipes])


def _lamp() -> tuple[Geometry, Geometry]:
    """A school pendant: enamelled metal with rod and rose; opal glass ball. Hangs from (0, 0, 0)."""
    drop = 0.62
    metal = [
        lathe([(0, -0.03), (0.04, -0.03), (0.055, -0.012), (0.055, 0.0), (0, 0.0)], 40),
        tube([(0, -drop, 0), (0, -drop / 2, 0), (0, -0.02, 0)], 0.008, 16),
        lathe([(0, -0.02), (0.06, -0.02), (0.062, 0.0), (0.05, 0.04), (0.02, 0.06), (0, 0.062)], 40).at(
            0, -drop - 0.02, 0
        ),
    ]
    return merge(metal), ball(0.16, 56, 36).at(0, -drop - 0.17, 0)


def _teachers_desk() -> Geometry:
    """A wide wooden desk with two pedestals of drawers; top at 0.78 m, the front panel towards the class (+Z)."""
    parts = [
        rounded_box((-0.85, 0.745, -0.4), (0.85, 0.78, 0.4), 0.01, 3),
        rounded_box((-0.8, 0.12, 0.3), (0.8, 0.745, 0.325), 0.005),
    ]
    for side in (-1, 1):
        x0, x1 = sorted((side * 0.42, side * 0.8))
        parts.append(rounded_box((x0, 0.05, -0.36), (x1, 0.745, 0.3), 0.006))
        for y in (0.08, 0.3, 0.52):
            parts.append(rounded_box((x0 + 0.02, y, -0.378), (x1 - 0.02, y + 0.2, -0.35), 0.006, 2))
            parts.append(ball(0.014, 20, 12).at((x0 + x1) / 2, y + 0.1, -0.39))
        for x in (x0 + 0.03, x1 - 0.03):
            parts += [cuboid((x - 0.025, 0, z - 0.025), (x + 0.025, 0.06, z + 0.025)) for z in (-0.32, 0.26)]
    return merge(parts)


def _desk_lamp() -> Geometry:
    """An articulated lamp with a conical shade."""
    shade = [(0.022, 0.12), (0.03, 0.1), (0.045, 0.08), (0.09, 0.0), (0.088, 0.0), (0.043, 0.077), (0.0, 0.09)]
    outline = [(0, 0.12), *shade[::1]]
    head = lathe(outline[::-1], 40).placed(translation(0.33, 0.46, 0) @ rotation("z", 0.5))
    return merge(
        [
            lathe([(0, 0), (0.09, 0), (0.095, 0.008), (0.085, 0.022), (0.02, 0.03), (0, 0.03)], 48),
            tube(smooth_path([(0, 0.02, 0), (-0.07, 0.17, 0), (-0.14, 0.32, 0)], 10), 0.007, 14),
            tube(smooth_path([(-0.14, 0.32, 0), (0.08, 0.45, 0), (0.29, 0.575, 0)], 10), 0.007, 14),
            ball(0.016, 20, 12).at(-0.14, 0.32, 0),
            head,
        ]
    )


def _plant(rng: np.random.Generator, leaves: int) -> tuple[Geometry, Geometry]:
    """A potted plant with arching blades; pot and foliage, at the origin."""
    pot = lathe(
        [(0, 0), (0.075, 0), (0.1, 0.13), (0.115, 0.135), (0.118, 0.17), (0.105, 0.172), (0.095, 0.15), (0, 0.15)], 48
    )  # fmt: skip
    t = np.linspace(0, 1, 13)
    blades = []
    for k in range(leaves):
        heading, lean = k * 2.39996, 0.35 + 0.75 * (1 - k / leaves) + 0.2 * rng.random()
        long = rng.uniform(0.2, 0.31)
        rise = t * math.cos(lean * 0.6) - 0.75 * lean * t**2.2
        out = t * math.sin(lean) + 0.1 * t**2
        half = 0.02 * np.sin(math.pi * t**0.6) + 0.0015
        middle = np.stack([out, rise, 0 * t], 1) * long
        fold = 0.35 * half
        rows = np.stack([
            middle + np.stack([0 * t, fold, half], 1),
            middle + np.stack([0 * t, fold * 0.25, half * 0.5], 1),
            middle,
            middle + np.stack([0 * t, fold * 0.25, -half * 0.5], 1),
            middle + np.stack([0 * t, fold, -half], 1),
        ], 1)  # fmt: skip
        blade = plate(rows, 0.0012).at(0.02 * math.cos(heading), 0.15, -0.02 * math.sin(heading), heading)
        shade = (rng.integers(0, 12) + 0.5) / 12
        blades.append(
            Geometry(
                blade.positions, blade.normals, (blade.uvs * (0, 1) + (shade, 0)).astype(np.float32), blade.indices
            )
        )
    return pot, merge(blades)


def _chalk_drawing() -> list[Floats]:
    """On the board: polar plots of Henyey–Greenstein's phase function, a beam through a slit, and a decaying curve."""
    strokes: list[Floats] = []
    theta = np.linspace(0, 2 * math.pi, 240)
    for g, size in ((0.0, 0.16), (0.35, 0.1), (0.6, 0.042)):
        lobe = size * (1 - g * g) / (1 + g * g - 2 * g * np.cos(theta)) ** 1.5
        strokes.append(np.stack([0.55 + lobe * np.cos(theta), 0.52 + lobe * np.sin(theta)], 1))
    strokes.append(np.array([(0.22, 0.52), (1.02, 0.52)]))
    strokes.append(np.array([(0.08, 0.52), (0.2, 0.52), (0.17, 0.55), (0.2, 0.52), (0.17, 0.49)]))
    strokes += [np.array([(1.3, y0), (1.3, y1)]) for y0, y1 in ((0.2, 0.42), (0.5, 0.8))]
    strokes += [np.array([(1.16, 0.58 + dy), (1.72, 0.30 + dy)]) for dy in (-0.09, -0.045, 0.0)]
    strokes.append(np.array([(1.95, 0.8), (1.95, 0.2), (2.75, 0.2)]))
    x = np.linspace(0, 0.75, 60)
    strokes.append(np.stack([1.95 + x, 0.2 + 0.52 * np.exp(-3.2 * x)], 1))
    strokes.append(np.stack([1.95 + x, 0.2 + 0.52 * (1 - np.exp(-3.2 * x))], 1))
    scribble = np.linspace(0, 1, 160)
    for row, (start, width) in enumerate(((0.2, 0.5), (0.2, 0.72), (2.05, 0.5))):
        y = 0.86 - 0.05 * (row % 2) if row < 2 else 0.88
        strokes.append(
            np.stack(
                [
                    start + width * scribble,
                    y + 0.014 * np.sin(70 * width * scribble + row) * np.sin(9 * scribble + row),
                ],
                1,
            )
        )
    return strokes


def _globe() -> tuple[Geometry, Geometry]:
    """Ball and brass stand of a desk globe on the origin, 0.4 m tall."""
    tilt = rotation("z", math.radians(-23))
    arc = np.linspace(-math.pi / 2, math.pi / 2, 40)
    meridian = tube(np.stack([0.15 * np.cos(arc) * -1, 0.15 * np.sin(arc), 0 * arc], 1), 0.006, 12)
    stand = [
        lathe([(0, 0), (0.1, 0), (0.1, 0.012), (0.06, 0.025), (0.015, 0.04), (0.012, 0.08), (0, 0.082)], 48),
        meridian.placed(translation(0, 0.23, 0) @ tilt),
    ]
    sphere = ball(0.135, 96, 64)
    sphere = sphere.retextured(scale=(1 / (2 * math.pi * 0.135), 1 / (math.pi * 0.135)))
    return sphere.placed(translation(0, 0.23, 0) @ tilt), merge(stand)


def _matte(name: str, color: tuple[float, float, float], roughness: float = 0.8) -> Material:
    return Material(name, base_color=(*color, 1.0), roughness=roughness)


def _textured(texture: Texture, name: str, roughness: float) -> Material:
    return Material(name, base_color=(1, 1, 1, 1), roughness=roughness, base_color_texture=texture)


def blinds(lights: int = 1, seed: int = 0) -> Scene:
    """A classroom in the late afternoon: the sun falls through Venetian blinds in thin slanted sheets.

    Args:
        lights: 1 to 32 directional lights.
        seed: of textures, books and clutter.

    Raises:
        ParameterError: ``lights`` or ``seed`` is not a whole number in range.
    """
    options = Options(lights, seed)
    rng = np.random.default_rng(options.seed)
    instances: list[Instance] = []

    def add(part: Geometry | Mesh, material: Material, name: str, *where: Matrix) -> None:
        mesh = part if isinstance(part, Mesh) else part.mesh(material, name)
        instances.extend(Instance(mesh, matrix, name) for matrix in (where or (np.eye(4),)))  # type: ignore[arg-type]

    oak = _textured(textures.wood(rng, "oak", (0.50, 0.33, 0.19), (0.70, 0.50, 0.31)), "oak", 0.5)
    walnut = _textured(textures.wood(rng, "walnut", (0.27, 0.16, 0.09), (0.44, 0.28, 0.17)), "walnut", 0.5)
    parquet = _textured(
        textures.wood(rng, "floor", (0.38, 0.25, 0.15), (0.60, 0.42, 0.26), planks=8, metres=1.1), "floor", 0.4
    )
    plaster = _textured(
        textures.mottled(rng, "plaster", (0.84, 0.79, 0.68), (0.90, 0.86, 0.77), beta=2.4, metres=2.0), "plaster", 0.95
    )
    ceiling = _textured(
        textures.mottled(rng, "ceiling", (0.88, 0.87, 0.84), (0.93, 0.92, 0.90), beta=2.4, metres=2.0), "ceiling", 0.95
    )
    panelling = _textured(
        textures.wood(rng, "panelling", (0.30, 0.40, 0.37), (0.38, 0.48, 0.44), size=256), "panelling", 0.6
    )
    book_covers = _textured(
        textures.swatches(
            rng, "books",
            [(0.50, 0.16, 0.13), (0.16, 0.26, 0.40), (0.18, 0.34, 0.24), (0.62, 0.48, 0.24), (0.33, 0.22, 0.30),
             (0.72, 0.66, 0.55), (0.24, 0.24, 0.26), (0.58, 0.32, 0.16)] + [(0.87, 0.83, 0.72)] * 8,
        ), "books", 0.7,
    )  # fmt: skip
    leaf = _textured(
        textures.swatches(rng, "leaves", [(0.20, 0.36, 0.13), (0.28, 0.44, 0.17), (0.36, 0.50, 0.22)]), "leaves", 0.5
    )
    terracotta = _textured(
        textures.mottled(rng, "terracotta", (0.58, 0.30, 0.19), (0.70, 0.40, 0.26), metres=0.5), "terracotta", 0.85
    )
    steel = _matte("steel", (0.16, 0.19, 0.20), 0.35)
    enamel = _matte("enamel", (0.72, 0.70, 0.64), 0.35)
    paint = _matte("paint", (0.80, 0.79, 0.74), 0.5)

    for name, part in _shell().items():
        add(part, {"floor": parquet, "walls": plaster, "ceiling": ceiling, "panelling": panelling}[name], name)
    widths = {far - near for near, far in WINDOWS}
    width = max(widths)
    frame = _window_frame(width).mesh(paint, "window frame")
    full, half_raised = (_blind(width, raised).mesh(enamel, "blind") for raised in (0.0, 0.4))
    radiator = _radiator(1.5).mesh(paint, "radiator")
    for k, (near, _) in enumerate(WINDOWS):
        add(frame, paint, "window frame", translation(0, 0, near))
        add(half_raised if k == 1 else full, enamel, "blind", translation(0, 0, near))
        add(radiator, paint, "radiator", translation(0, 0, near + 0.2))

    desk_frame, desk_wood = _desk()
    chair_frame, chair_wood = _chair()
    desks = [translation(x, 0, z) @ rotation("y", rng.normal(0, 0.02)) for x in COLUMNS for z in ROWS]
    chairs = [
        translation(x + rng.normal(0, 0.03), 0, z + 0.42 + 0.14 * rng.random()) @ rotation("y", rng.normal(0, 0.13))
        for x in COLUMNS
        for z in ROWS
    ]
    chairs.append(translation(4.7, 0, 0.35) @ rotation("y", math.pi + 0.25))
    add(desk_frame, steel, "desk frame", *desks)
    add(desk_wood, oak, "desk", *desks)
    add(chair_frame, steel, "chair frame", *chairs)
    add(chair_wood, oak, "chair", *chairs)

    shelf, standing = _shelf_and_books(rng)
    add(shelf, walnut, "bookcase")
    add(_books(rng, np.concatenate([standing, _lying_books(rng)])), book_covers, "books")
    add(_pencils(rng), book_covers, "pencils")
    add(_papers(rng), _matte("paper", (0.86, 0.85, 0.80), 0.9), "papers")
    add(_teachers_desk(), walnut, "teacher's desk", translation(4.7, 0, 1.05))
    add(
        _desk_lamp(),
        _matte("lamp", (0.08, 0.22, 0.17), 0.3),
        "desk lamp",
        translation(5.35, 0.78, 1.2) @ rotation("y", 2.6),
    )

    metal, glass = _lamp()
    hung = [translation(x, HEIGHT, z) for x in (1.9, 5.1) for z in (1.5, 3.85, 6.2)]
    add(metal, steel, "lamp", *hung)
    add(glass, _matte("opal glass", (0.88, 0.87, 0.82), 0.3), "lamp glass", *hung)

    board_aspect = 3.0 / 1.2
    slate = Material(
        "blackboard", base_color=(1, 1, 1, 1), roughness=0.75,
        base_color_texture=textures.chalkboard(rng, "blackboard", _chalk_drawing(), board_aspect, size=1024),
    )  # fmt: skip
    left, bottom = 1.3, 1.16
    surface = [
        (left, bottom, 0.05),
        (left + 3, bottom, 0.05),
        (left + 3, bottom + 1.2, 0.05),
        (left, bottom + 1.2, 0.05),
    ]
    add(flat(surface, (0, 0, 1), [(0, 1), (1, 1), (1, 0), (0, 0)]), slate, "blackboard")
    bar = 0.06
    frame_parts = [
        rounded_box((left - bar, bottom - bar, 0), (left, bottom + 1.2 + bar, 0.07), 0.008, 2),
        rounded_box((left + 3, bottom - bar, 0), (left + 3 + bar, bottom + 1.2 + bar, 0.07), 0.008, 2),
        rounded_box((left, bottom - bar, 0), (left + 3, bottom, 0.07), 0.008, 2),
        rounded_box((left, bottom + 1.2, 0), (left + 3, bottom + 1.2 + bar, 0.07), 0.008, 2),
        rounded_box((left, bottom - bar - 0.015, 0), (left + 3, bottom - bar, 0.14), 0.006, 2),
    ]
    add(merge(frame_parts), oak, "blackboard frame")
    stick = lathe([(0, 0), (0.004, 0), (0.005, 0.002), (0.005, 0.07), (0.004, 0.072), (0, 0.072)], 16)
    laid = [
        stick.placed(
            translation(left + 0.4 + 0.43 * k, bottom - bar + 0.005, 0.1)
            @ rotation("y", 0.3 * k)
            @ rotation("z", math.pi / 2)
        )
        for k in range(6)
    ]
    add(merge(laid), _matte("chalk", (0.9, 0.89, 0.85), 0.95), "chalk")

    clock_face = lathe([(0, 0), (0.15, 0), (0.15, 0.028), (0, 0.028)], 64).placed(
        translation(5.35, 2.45, 0) @ rotation("x", math.pi / 2)
    )
    add(clock_face, _matte("clock face", (0.88, 0.87, 0.82), 0.4), "clock face")
    ring = lathe([(0.148, 0), (0.172, 0.0), (0.176, 0.03), (0.165, 0.045), (0.15, 0.04), (0.148, 0)], 64)
    ticks = [
        cuboid((-0.003, 0.115, 0.028), (0.003, 0.138, 0.031)).placed(rotation("z", k * math.pi / 6)) for k in range(12)
    ]
    hands = [cuboid((-0.004, -0.02, 0.031), (0.004, 0.08, 0.034)).placed(rotation("z", 1.1))]
    hands.append(cuboid((-0.003, -0.025, 0.034), (0.003, 0.12, 0.037)).placed(rotation("z", -2.2)))
    clock = merge([ring.placed(rotation("x", math.pi / 2)), *ticks, *hands])
    add(clock, _matte("clock rim", (0.07, 0.07, 0.075), 0.4), "clock", translation(5.35, 2.45, 0))

    sills = [(0.045, SILL + 0.012, near + at) for (near, _), at in zip(WINDOWS, (1.55, 0.3, 1.6), strict=True)]
    pots = [_plant(rng, n) for n in (28, 34, 38)]
    for (pot, foliage), sill in zip(pots, sills, strict=True):
        add(pot, terracotta, "pot", translation(*sill))
        add(foliage, leaf, "plant", translation(*sill))

    sphere, stand = _globe()
    globe_at = translation(4.1, 0.78, 1.05)
    add(stand, _matte("brass", (0.55, 0.42, 0.20), 0.35), "globe stand", globe_at)
    centre = np.array([0, 0.23, 0])

    def on_globe(points: Floats) -> Floats:
        radial = points - centre
        return np.asarray(centre + 0.135 * radial / np.linalg.norm(radial, axis=-1, keepdims=True))

    missing = TRIANGLES - sum(i.mesh.triangle_count for i in instances) - sphere.triangle_count
    globe = _textured(textures.globe(rng, "globe"), "globe", 0.4)
    add(refine(sphere, missing, on_globe), globe, "globe", globe_at)

    return Scene(
        instances=tuple(instances),
        lights=suns(options.lights, SUN, 50.0, (1.0, 0.88, 0.70), (18, 50), spread=90.0),
        camera=Camera((2.75, 1.32, 6.9), (1.0, 1.3, 3.4), fov=math.radians(60), exposure=-0.6),
        medium=Medium(
            (0.09,) * 3,
            (0.005,) * 3,
            HenyeyGreenstein(0.5),
            ((-WALL, -WALL, -WALL), (WIDTH + WALL, HEIGHT + WALL, LENGTH + WALL)),
        ),
        background=(4.6, 5.3, 6.3),
        ambient=(0.75, 0.77, 0.82),
        looks={
            "screen_space": {"exposure": 1.0, "decay": 0.9, "weight": 0.002},
            "polygonal": {"g": 0.5, "tau": 1.99e-5},
            "froxel": {"g": 0.5, "z_limit": 11.0, "density": 0.1, "c_s": 0.18},
        },
        name="blinds",
    )
