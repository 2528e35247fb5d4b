"""`portrait`: a young woman with auburn hair, a knitted scarf and flowers in her hair looks over her shoulder.

Her head turns as one object, and her lids are parts of it, so that a glance or a blink changes few numbers. The unit
is a decimetre that is called a metre: her head is about two high.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from tyndall.scene.bundled.sunlight import Options, suns
from tyndall.scene.model import Camera, Implicit, Scene
from tyndall.sdf.scenes.parts import about, ball, curve, egg, limb, paint, rows, spin, strand
from tyndall.sdf.shape import Floats, Shape, intersection, subtraction, union
from tyndall.sdf.solids import box, cylinder, sphere, torus

SUN = (0.62, -0.52, -0.66)
NECK = (0.0, -1.15, -0.2)  # what the head turns about
BLINK = 3.7  # s, from one blink to the next

SKIN = paint("#eeb294", 0.55)
LIPS = paint("#c4525a", 0.35)
WHITE = paint("#f6f0ea", 0.2)
IRIS = paint("#3f8f86", 0.25)
RIM = paint("#1f4a4a", 0.3)
PUPIL = paint("#0c0a0c", 0.1)
SHINE = paint("#ffffff", 0.4, glow=1.8)
LASH = paint("#2a1512", 0.6)
BROW = paint("#5f2a1a", 0.8)
FRECKLE = paint("#cf8a68", 0.7)
HAIR = tuple(paint(c, 0.42) for c in ("#8c3b1e", "#a34a24", "#7a3019", "#b55a2c"))
SCARF = tuple(paint(c, 0.95) for c in ("#1f6f78", "#2b8189", "#e9d8b4"))
COAT = paint("#d9a441", 0.95)
COLLAR = paint("#c08a2e", 0.95)
BUTTON = paint("#6b3a1f", 0.4)
GOLD = paint("#f0b64a", 0.25, metallic=1.0)
PETALS = (paint("#fff3e2", 0.7), paint("#f4a6a0", 0.7), paint("#f7d774", 0.7))
YOLK = paint("#e8a52c", 0.8)
SPRIG = paint("#6f9463", 0.8)
WALL = paint("#6f8f94", 1.0)
DISC = paint("#f2c79a", 1.0)

EYES = ((0.365, -0.03, 0.66), (-0.365, -0.03, 0.66))
EYE = 0.245  # radius
UPPER = 21.0  # degrees, of the edge of the upper lids above the level


def _skull() -> Shape:
    head = union(
        egg((0, 0.28, -0.14), (0.97, 1.03, 1.02)),
        egg((0, -0.3, 0.12), (0.74, 0.82, 0.77)),
        egg((0, -0.86, 0.5), (0.22, 0.17, 0.19)),
        ball((0.43, -0.4, 0.5), 0.3),
        ball((-0.43, -0.4, 0.5), 0.3),
        limb((-0.4, 0.3, 0.7), (0.4, 0.3, 0.7), 0.14),
        smooth=0.22,
    )
    sockets = [ball(eye, EYE + 0.012) for eye in EYES]
    nose = union(
        limb((0, 0.1, 0.82), (0, -0.25, 1.0), 0.075, 0.09),
        ball((0, -0.31, 1.03), 0.115),
        ball((0.1, -0.35, 0.93), 0.075),
        ball((-0.1, -0.35, 0.93), 0.075),
        smooth=0.08,
    )
    nostrils = [egg((0.055 * side, -0.405, 1.02), (0.035, 0.03, 0.045)) for side in (-1, 1)]
    face = union(subtraction(head, *sockets, smooth=0.07), nose, smooth=0.09)
    mouth = egg((0, -0.63, 0.9), (0.2, 0.02, 0.09))
    return subtraction(face, *nostrils, mouth, smooth=0.03)


def laid(shape: Shape, points: Sequence[tuple[float, float]], lift: float = 0.0) -> Floats:
    """(N, 3) places where a shape is met along −Z at x and y, by its own distances; a lift moves them along Z."""
    places = np.array([(x, y, 2.0) for x, y in points])
    for _ in range(48):
        places[:, 2] -= shape(places)
    return places + [0, 0, lift]


def _lips(face: Shape) -> Shape:
    upper: list[Shape] = []
    for side in (-1, 1):
        path = laid(face, [(side * x, y) for x, y in ((0.27, -0.562), (0.15, -0.61), (0.05, -0.6), (0.0, -0.61))])
        upper += strand(path + [0, 0, -0.005], (0.014, 0.034, 0.042, 0.036), 4)
    below = laid(face, [(-0.25, -0.572), (-0.13, -0.675), (0, -0.7), (0.13, -0.675), (0.25, -0.572)], -0.005)
    lower = strand(below, (0.012, 0.044, 0.054, 0.044, 0.012), 6)
    return union(union(*upper, smooth=0.025), union(*lower, smooth=0.03)).material(LIPS)


def _lid(edge: float, radius: float) -> Shape:
    """Half a ball around 0 above a plane through +X whose front edge stands so many degrees above the level."""
    half = box((1.0, 1.0, 1.0)).at(0, 0.5, 0).transform(spin(-edge))
    return intersection(sphere(radius), half)


def _eye(gaze: Sequence[float]) -> Shape:
    way = np.asarray(gaze) / np.linalg.norm(gaze)
    front = 0.235 * way
    return union(
        sphere(EYE).material(WHITE),
        (ball(front, 0.145) & sphere(EYE + 0.006)).material(RIM),
        (ball(front, 0.127) & sphere(EYE + 0.010)).material(IRIS),
        (ball(front, 0.07) & sphere(EYE + 0.014)).material(PUPIL),
        ball(front + [-0.05, 0.065, 0.012], 0.026).material(SHINE),
        ball(front + [0.045, -0.05, 0.012], 0.013).material(SHINE),
    )


def _lashes(side: int) -> list[Shape]:
    """The dark edge of the upper lid, in the lid's own space."""
    parts: list[Shape] = []
    angles = np.linspace(-62, 70, 8)
    radius = EYE + 0.035
    tilt = math.radians(UPPER + 3)
    places = []
    for a in np.radians(angles) * side:
        flat = radius * math.cos(a)
        places.append((radius * math.sin(a), flat * math.sin(tilt), flat * math.cos(tilt)))
    for i in range(len(places) - 1):
        wide = 0.012 + 0.016 * (i + 1) / len(places)
        parts.append(limb(places[i], places[i + 1], wide, wide + 0.002))
    x, y, z = places[-1]
    parts.append(limb((x, y, z), (x + 0.075 * side, y + 0.045, z - 0.03), 0.026, 0.006))
    return parts


def _brow(face: Shape, side: int) -> Shape:
    path = laid(face, [(side * x, y) for x, y in ((0.15, 0.35), (0.3, 0.42), (0.48, 0.42), (0.64, 0.32))])
    return union(*strand(path, (0.04, 0.045, 0.036, 0.014), 5), smooth=0.02)


def _ear(side: int) -> Shape:
    shell = union(
        egg((0, 0, 0), (0.08, 0.24, 0.16), spin(0, 24 * side)) - egg((0.07 * side, 0.03, 0.03), (0.06, 0.15, 0.09)),
        ball((0.0, -0.2, 0.02), 0.075),
        limb((0.02 * side, 0.02, 0.1), (0.04 * side, -0.06, 0.06), 0.04),
        smooth=0.04,
    ).material(SKIN)
    ring = torus(0.12, 0.022).orient((1, 0, 0.4)).at(0.03 * side, -0.38, 0.03)
    drop = ball((0.03 * side, -0.53, 0.03), 0.05)
    return union(shell, union(ring, drop).material(GOLD)).at(0.93 * side, -0.17, -0.02)


def _flower(color: int, size: float) -> Shape:
    """It looks along +Z."""
    petals = []
    for k in range(6):
        petals.append(egg((0.12, 0, 0.015), (0.1, 0.062, 0.028), spin(0, -16)).transform(spin(z=60.0 * k)))
    return union(union(*petals).material(PETALS[color]), egg((0, 0, 0.03), (0.06, 0.06, 0.04)).material(YOLK)).scale(
        size
    )


def _ornament() -> Shape:
    """Flowers and leaves on the right of the head."""
    parts: list[Shape] = []
    for (x, y, z), color, size in (
        ((-0.93, 0.62, 0.42), 0, 1.7),
        ((-0.72, 1.0, 0.42), 1, 1.3),
        ((-1.08, 0.28, 0.3), 1, 1.3),
        ((-0.68, 0.8, 0.68), 2, 1.05),
        ((-1.1, 0.62, 0.05), 2, 1.2),
        ((-0.92, 1.02, 0.1), 0, 1.2),
    ):
        parts.append(_flower(color, size).orient((x, y - 0.3, z + 0.25)).at(x * 1.13, y * 1.08, z * 1.1))
    for x, y, z, turn in (
        (-0.72, 1.22, 0.24, 40),
        (-1.13, 0.0, 0.3, -60),
        (-1.16, 0.45, -0.05, 10),
        (-0.86, 0.42, 0.72, 100),
        (-0.5, 1.05, 0.68, 140),
    ):
        parts.append(egg((x * 1.04, y, z), (0.21, 0.035, 0.085), spin(20, turn, turn)).material(SPRIG))
    return union(*parts)


def _lock(points: ArrayLike, width: Sequence[float], pieces: int, shade: int) -> Shape:
    return union(*strand(points, width, pieces), smooth=0.03).material(HAIR[shade % len(HAIR)])


def _over(start: Sequence[float], end: Sequence[float], count: int, lift: float) -> Floats:
    """(count, 3) places from a start to an end over the head."""
    middle, radii = np.array(CROWN[0]), np.array(CROWN[1])
    line = np.linspace((np.array(start) - middle) / radii, (np.array(end) - middle) / radii, count)
    raised = 1 + lift * np.sin(np.linspace(0, math.pi, count))[:, None]
    return np.asarray(middle + radii * line / np.linalg.norm(line, axis=1, keepdims=True) * raised)


CROWN = ((0.0, 0.38, -0.2), (1.07, 1.06, 1.08))  # middle and radii of the head with its hair


def _hair() -> Shape:
    cap = subtraction(
        union(egg(*CROWN), egg((0, -0.2, -0.5), (1.0, 0.95, 0.75)), smooth=0.2),
        egg((0.06, -0.42, 1.0), (0.84, 1.13, 0.95)),
        smooth=0.06,
    ).material(HAIR[2])
    locks: list[Shape] = []
    # A parting on her right, from which the hair sweeps over the forehead to the left, and down to the right.
    for k in range(10):
        u = k / 9
        parting = (-0.34 + 0.1 * u, 1.35 - 0.1 * u * u, 0.62 - 1.1 * u)
        over = _over(parting, (0.93 + 0.1 * u, 0.22, 0.5 - 1.0 * u), 4, 0.05 * (1 - u))
        tail = [(1.05, -0.3 + 0.05 * (k % 2), 0.3 - 0.7 * u), (0.97, -0.75 - 0.1 * (k % 3), 0.26 - 0.6 * u)]
        locks.append(_lock([*over, *tail], (0.045, 0.125, 0.14, 0.12, 0.1, 0.03), 8, k))
    for k in range(8):
        u = k / 7
        parting = (-0.37 + 0.1 * u, 1.33 - 0.1 * u * u, 0.64 - 1.1 * u)
        over = _over(parting, (-0.95 - 0.08 * u, 0.2, 0.45 - 0.95 * u), 4, 0.05 * (1 - u))
        tail = [(-1.06, -0.35, 0.28 - 0.6 * u), (-0.95, -0.85 - 0.1 * (k % 3), 0.25 - 0.6 * u)]
        locks.append(_lock([*over, *tail], (0.045, 0.11, 0.13, 0.11, 0.1, 0.03), 7, k + 1))
    # Waves down her back.
    for k in range(9):
        a = math.radians(198 + 18 * k)
        x, z = 0.95 * math.cos(a), 0.85 * math.sin(a) - 0.2
        wave = 0.09 * (1 if k % 2 else -1)
        path = [
            (x, 0.1, z),
            (1.1 * x + wave, -0.7, 1.1 * z),
            (1.05 * x - wave, -1.35, 1.12 * z - 0.05),
            (1.15 * x + wave, -1.95, 1.25 * z),
        ]
        locks.append(_lock(path, (0.22, 0.24, 0.2, 0.07), 5, k))
    # A loose curl before each ear.
    for side in (-1, 1):
        path = [
            (0.86 * side, 0.3, 0.56),
            (0.95 * side, -0.25, 0.52),
            (0.8 * side, -0.7, 0.5),
            (0.92 * side, -1.1, 0.42),
        ]
        locks.append(_lock(path, (0.045, 0.06, 0.05, 0.014), 6, 3))
    return union(cap, *locks, smooth=0.02)


def _braid() -> Shape:
    """A plait that falls over her left shoulder: two rows of beads that cross."""
    spine = curve([(0.95, -0.75, -0.35), (1.12, -1.3, 0.05), (1.12, -1.9, 0.42), (1.02, -2.55, 0.55)], 12)
    beads: list[Shape] = []
    for i, p in enumerate(spine):
        side = 1 if i % 2 else -1
        size = 0.23 - 0.006 * i
        beads.append(
            egg(p + [0.085 * side, 0, 0.02], (0.85 * size, 1.15 * size, size), spin(0, 0, 32 * side)).material(
                HAIR[i % 4]
            )
        )
    tie = torus(0.1, 0.05).orient((0.1, 1, -0.2)).at(*(spine[-1] + [0, -0.17, 0.03])).material(SCARF[0])
    tuft = [
        limb(spine[-1] + [0, -0.2, 0.03], spine[-1] + [x, -0.55, 0.03 + z], 0.09, 0.02)
        for x, z in ((-0.1, 0), (0.02, 0.07), (0.12, 0))
    ]
    return union(union(*beads, smooth=0.03), tie, union(*tuft, smooth=0.04).material(HAIR[1]))


def head() -> Shape:
    """Head with hair, in its own space; parts ``lids``, both of them."""
    gaze = (-0.2, 0.0, 1.0)
    eyes: list[Shape] = []
    lids: list[Shape] = []
    for side, place in zip((1, -1), EYES, strict=True):
        eyes.append(_eye(gaze).at(*place))
        upper = _lid(UPPER, EYE + 0.032).material(SKIN)
        lids.append(union(upper, union(*_lashes(side)).material(LASH)).named("lids").at(*place))
        under = intersection(sphere(EYE + 0.016), box((1.0, 1.0, 1.0)).at(0, -0.5, 0).transform(spin(30)))
        lids.append(under.at(*place).material(SKIN))
    face = _skull()
    spots = [(0.25, -0.3), (0.36, -0.36), (0.31, -0.43), (0.46, -0.33), (0.2, -0.4), (0.42, -0.44)]
    freckles = [egg(p, (0.017, 0.015, 0.008)) for p in laid(face, [(s * x, y) for s in (-1, 1) for x, y in spots])]
    skin = union(face.material(SKIN), *lids, smooth=0.035)
    return union(
        skin,
        *eyes,
        _lips(face),
        _brow(face, 1).material(BROW),
        _brow(face, -1).material(BROW),
        _ear(1),
        _ear(-1),
        union(*freckles).material(FRECKLE),
        _hair(),
        _ornament(),
    )


def _body() -> Shape:
    neck = union(
        limb((0, -0.75, -0.2), (0, -2.1, -0.3), 0.4, 0.46),
        limb((0.3, -1.1, 0.0), (0.08, -1.95, 0.15), 0.1),
        limb((-0.3, -1.1, 0.0), (-0.08, -1.95, 0.15), 0.1),
        smooth=0.12,
    )
    coat = union(
        egg((0, -3.25, -0.35), (1.55, 1.25, 0.8)),
        limb((-1.25, -2.75, -0.4), (1.25, -2.75, -0.4), 0.5),
        limb((0, -2.2, -0.35), (1.15, -2.6, -0.4), 0.4, 0.5),
        limb((0, -2.2, -0.35), (-1.15, -2.6, -0.4), 0.4, 0.5),
        limb((1.5, -2.85, -0.4), (1.85, -4.2, -0.25), 0.5, 0.46),
        limb((-1.5, -2.85, -0.4), (-1.85, -4.2, -0.25), 0.5, 0.46),
        limb((0.12, -2.5, 0.45), (0.16, -4.4, 0.5), 0.06),
        *(limb((1.42 * s, -2.5, 0.02), (1.3 * s, -3.5, 0.1), 0.035) for s in (-1, 1)),
        smooth=0.2,
    )
    coat = intersection(coat, box((5, 3, 4)).at(0, -2.6, 0)).material(COAT)
    buttons = [egg((0.0, -2.75 - 0.5 * i, 0.5 + 0.03 * i), (0.09, 0.09, 0.04)).material(BUTTON) for i in range(3)]
    return union(neck.material(SKIN), coat, *buttons)


def _scarf() -> Shape:
    wraps = []
    for k, (y, major, minor, tilt) in enumerate(
        ((-2.12, 0.72, 0.3, (0.05, 1, 0.16)), (-1.82, 0.64, 0.27, (-0.12, 1, 0.1)), (-1.58, 0.58, 0.2, (0.1, 1, 0.2)))
    ):
        wraps.append(torus(major, minor).orient(tilt).at(0, y, -0.22).material(SCARF[k % 2]))
    ribs = []
    for k in range(26):
        a = 2 * math.pi * k / 26
        for y, major, minor, slope in ((-2.12, 0.72, 0.3, 0.14), (-1.82, 0.64, 0.27, 0.1)):
            x, z = math.cos(a), math.sin(a)
            out = major + 0.93 * minor
            high = y - slope * z * major
            if z > -0.4:
                ribs.append(
                    limb(
                        (out * x, high - 0.13, out * z - 0.22),
                        ((out - 0.03) * x, high + 0.13, (out - 0.03) * z - 0.22),
                        0.035,
                    )
                )
    tail = strand(
        [(-0.42, -2.05, 0.5), (-0.52, -2.6, 0.68), (-0.5, -3.2, 0.72), (-0.58, -3.9, 0.72)], (0.24, 0.27, 0.29), 6
    )
    flat = union(*tail, smooth=0.06)
    bands = [torus(0.26, 0.06).orient((0.1, 1, 0)).at(-0.52, y, 0.7).material(SCARF[2]) for y in (-3.0, -3.25)]
    return union(
        union(*wraps, smooth=0.05), union(*ribs).material(SCARF[1]), flat.material(SCARF[0]), *bands, smooth=0.03
    )


def _backdrop() -> Shape:
    disc = cylinder(3.45, 0.12).at(-0.55, 0.1, -8.7).material(DISC)
    wall = box((30, 18, 0.3)).at(0, 0, -9.0).material(WALL)
    ring = torus(3.85, 0.045).at(-0.55, 0.1, -8.8).material(GOLD)
    return union(disc, wall, ring)


def _turn(time: float) -> Floats:
    return about(NECK, spin(3 * math.sin(0.9 * time), 18 + 16 * math.sin(0.5 * time), -5 + 3 * math.sin(0.7 * time)))


REST = np.linalg.inv(_turn(0.0))


def motion(time: float) -> Mapping[str, ArrayLike]:
    """How the head and its lids have moved at a time in seconds: a slow glance to each side, and blinks."""
    phase = (time + 2.6) % BLINK
    shut = max(0.0, 1 - abs(phase - 0.14) / 0.13)
    lids = np.broadcast_to(spin(46 * shut * shut * (3 - 2 * shut)), (2, 4, 4))
    return {"head": _turn(time) @ REST, "lids": lids}


def portrait(*, lights: int = 1, seed: int = 0) -> Scene:
    """A young woman with auburn hair, a scarf and flowers in her hair turns her head and blinks.

    Args:
        lights: 1 to 32 directional lights; the first is the sun.
        seed: taken like every bundled scene's; nothing in this one is random.

    Raises:
        ParameterError: an option is not a whole number in range.
    """
    options = Options(lights, seed)
    return Scene(
        implicits=(
            Implicit(head(), rows(_turn(0.0)), SKIN, "head"),
            Implicit(union(_body(), _braid()), material=COAT, name="body"),
            Implicit(_scarf(), material=SCARF[0], name="scarf"),
            Implicit(_backdrop(), material=WALL, name="backdrop"),
        ),
        lights=suns(options.lights, SUN, 6.5, (1.0, 0.87, 0.70), (10, 50), 150),
        camera=Camera((0.35, -0.55, 9.6), (0.0, -0.62, 0), fov=math.radians(27), exposure=0.0),
        background=(0.16, 0.27, 0.30),
        ambient=(0.34, 0.38, 0.46),
        name="portrait",
        motion=motion,
        room=((-2.4, -4.2, -2.0), (2.4, 2.0, 2.0)),
    )
