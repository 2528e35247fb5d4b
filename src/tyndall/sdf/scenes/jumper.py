"""`jumper`: a cheerful creature hops around on a hilltop among trees, toadstools and flowers.

It squashes before it leaps and after it lands, and stretches on its way; its ears lag behind. A hop takes
:data:`PERIOD` seconds, and the way round :data:`HOPS` of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from tyndall.scene.bundled.sunlight import Options, suns
from tyndall.scene.model import Camera, Implicit, Scene
from tyndall.sdf.scenes.parts import about, ball, egg, limb, nearer, paint, rows, spin, strand
from tyndall.sdf.shape import Floats, Shape, intersection, union
from tyndall.sdf.solids import box, torus

PERIOD = 1.1  # s, of a hop
HOPS = 8  # once round
ROUND = 0.85  # m, radius of the way
HEIGHT = 1.05  # m, of a hop
EYE = (-1.55, 1.3, 5.7)
SUN = (-0.62, -0.66, -0.52)

FUR = paint("#f0713f", 0.75)
CREAM = paint("#fbe3c0", 0.8)
PINK = paint("#f2898f", 0.8)
DARK = paint("#20161a", 0.25)
SHINE = paint("#ffffff", 0.4, glow=1.6)
SCARF = paint("#23639c", 0.85)
FRINGE = paint("#f4cf5d", 0.85)
GRASS = paint("#7fb04a", 0.95)
MEADOW = paint("#9cc25a", 0.95)
FAR = paint("#7fb896", 1.0)
FARTHER = paint("#8fc0d0", 1.0)
PATH = paint("#e2cfa0", 0.9)
BARK = paint("#7a5138", 0.9)
CROWNS = (paint("#3f8f5b", 0.95), paint("#5aa453", 0.95), paint("#e79aa6", 0.95))
ROCK = paint("#9aa0a8", 0.85)
CAP = paint("#d23b35", 0.45)
STEM = paint("#f5ead6", 0.8)
PETALS = (paint("#fff4e0", 0.8), paint("#f7b0c0", 0.8), paint("#b9a4e6", 0.8))
YOLK = paint("#f6bd2f", 0.7)
CLOUD = paint("#ffffff", 1.0)


def _side(x: float, y: float, z: float, side: int) -> tuple[float, float, float]:
    return (side * x, y, z)


def _ear(side: int) -> Shape:
    """From its root upwards and outwards; the tip flops."""
    outer = [(0, 0, 0), _side(0.06, 0.3, -0.02, side), _side(0.2, 0.58, -0.05, side), _side(0.44, 0.62, -0.02, side)]
    inner = [
        _side(0.01, 0.1, 0.06, side),
        _side(0.065, 0.3, 0.055, side),
        _side(0.19, 0.53, 0.04, side),
        _side(0.38, 0.575, 0.05, side),
    ]
    return union(
        union(*strand(outer, (0.1, 0.125, 0.13, 0.07), 4), smooth=0.05).material(FUR),
        union(*strand(inner, (0.05, 0.075, 0.08, 0.035), 3), smooth=0.04).material(PINK),
        smooth=0.02,
    )


def _foot(side: int) -> Shape:
    return union(
        limb((0, 0.26, 0), (0, 0.02, 0.03), 0.14, 0.12).material(FUR),
        egg((0, -0.06, 0.13), (0.135, 0.1, 0.23), spin(18)).material(CREAM),
        smooth=0.08,
    )


def _arm(side: int) -> Shape:
    path = [(0, 0, 0), _side(0.2, 0.04, 0.08, side), _side(0.36, 0.22, 0.14, side)]
    hand = [egg(_side(0.38, 0.28, 0.15, side), (0.085, 0.1, 0.085)), ball(_side(0.3, 0.25, 0.19, side), 0.045)]
    return union(
        union(*strand(path, (0.13, 0.1, 0.085), 3), smooth=0.04).material(FUR),
        union(*hand, smooth=0.03).material(CREAM),
        smooth=0.04,
    )


def _face(side: int) -> list[Shape]:
    return [
        egg(_side(0.165, 1.215, 0.395, side), (0.078, 0.098, 0.06), spin(-8, 20 * side)).material(DARK),
        ball(_side(0.165, 1.255, 0.452, side) if side > 0 else (-0.125, 1.255, 0.452), 0.024).material(SHINE),
        egg(_side(0.3, 1.07, 0.335, side), (0.085, 0.055, 0.05), spin(0, 40 * side)).material(PINK),
        union(
            *strand(
                [_side(0.1, 1.385, 0.385, side), _side(0.165, 1.405, 0.385, side), _side(0.235, 1.37, 0.355, side)],
                (0.016, 0.022, 0.014),
                2,
            ),
            smooth=0.01,
        ).material(DARK),
    ]


def _trunk() -> Shape:
    """Body and head, the soles of its feet at y = 0."""
    fur = union(
        egg((0, 0.6, 0), (0.53, 0.56, 0.48)).material(FUR),
        egg((0, 1.16, 0.03), (0.47, 0.42, 0.42)).material(FUR),
        ball((0, 0.46, -0.5), 0.16).material(CREAM),
        smooth=0.14,
    )
    light = [egg((0, 0.57, 0.18), (0.35, 0.4, 0.345)), egg((0, 1.05, 0.36), (0.2, 0.14, 0.14))]
    fur = union(fur, *(part.material(CREAM) for part in light), smooth=0.06)
    tuft = union(
        *(limb((x / 3, 1.53, 0.1), (x, 1.7 - abs(x), 0.12), 0.05, 0.018).material(FUR) for x in (-0.09, 0.0, 0.1)),
        smooth=0.03,
    )
    smile = union(*strand([(-0.085, 1.01, 0.475), (0, 0.965, 0.5), (0.085, 1.01, 0.475)], (0.013, 0.017, 0.013), 4))
    scarf = union(
        torus(0.415, 0.085).orient((0.02, 1, 0.14)).at(0, 0.92, 0.03).material(SCARF),
        torus(0.39, 0.06).orient((-0.06, 1, 0.1)).at(0, 1.0, 0.04).material(SCARF),
        smooth=0.03,
    )
    tail = union(
        *(
            s.material(SCARF)
            for s in strand(
                [(-0.2, 0.86, -0.28), (-0.42, 1.02, -0.5), (-0.62, 1.28, -0.58), (-0.86, 1.4, -0.66)],
                (0.07, 0.085, 0.1),
                4,
            )
        ),
        *(s.material(FRINGE) for s in strand([(-0.86, 1.4, -0.66), (-1.0, 1.44, -0.68)], (0.1, 0.09), 1)),
        ball((-0.2, 0.87, -0.27), 0.1).material(SCARF),
        smooth=0.03,
    )
    features = [
        *_face(1),
        *_face(-1),
        egg((0, 1.115, 0.485), (0.055, 0.04, 0.035)).material(DARK),
        smile.material(DARK),
        _arm(1).at(0.4, 0.76, 0.1),
        _arm(-1).at(-0.4, 0.76, 0.1),
        scarf,
        tail,
    ]
    return union(union(fur, tuft, smooth=0.05), *features)


EARS = {"left ear": (0.17, 1.5, 0.0), "right ear": (-0.17, 1.5, 0.0)}
FEET = {"left foot": (0.24, 0.22, 0.06), "right foot": (-0.24, 0.22, 0.06)}


def creature() -> Shape:
    """The jumper at rest in the air: parts ``body``, ``left ear``, ``right ear``, ``left foot``, ``right foot``."""
    ears = [_ear(1 if at[0] > 0 else -1).at(*at).named(name) for name, at in EARS.items()]
    feet = [_foot(1 if at[0] > 0 else -1).at(*at).named(name) for name, at in FEET.items()]
    return union(_trunk().named("body"), *ears, *feet)


def _hop(time: float) -> tuple[Floats, dict[str, ArrayLike]]:
    """4×4 of the jumper's place, and how its parts have moved in its own space."""
    hop = time / PERIOD + 0.5
    phase = hop % 1.0
    # On the ground for the first and the last sixth of a hop.
    flight = min(1.0, max(0.0, (phase - 1 / 6) * 1.5))
    height = 4 * HEIGHT * flight * (1 - flight)
    speed = (1 - 2 * flight) if 0 < flight < 1 else 0.0
    crouch = max(0.0, 1 - abs(phase - 0.08) / 0.1, 1 - abs(phase - 0.93) / 0.08)
    tall = (1 + 0.16 * speed * speed) * (1 - 0.34 * crouch)
    squash = np.diag([tall**-0.5, tall, tall**-0.5, 1.0])

    way = 2 * math.pi * (math.floor(hop) + flight - 0.5) / HOPS
    lean = spin(-14 * speed)
    turned = spin(0, 24 - math.degrees(way)) @ lean
    place = np.eye(4)
    place[:3, 3] = ROUND * math.sin(way), height + 0.03, ROUND * (math.cos(way) - 1)
    parts: dict[str, ArrayLike] = {"body": squash}
    for (name, at), side in zip(EARS.items(), (1, -1), strict=True):
        parts[name] = squash @ about(
            at, spin(16 * speed, 0, side * (30 * max(speed, 0.0) + 9 * min(speed, 0.0) - 22 * crouch))
        )
    for name, at in FEET.items():
        parts[name] = about(at, spin(34 * abs(speed)))
    return place @ turned, parts


def motion(time: float) -> Mapping[str, ArrayLike]:
    """How the jumper and its parts have moved at a time in seconds; at 0 it is at the top of a hop."""
    place, parts = _hop(time)
    return {"jumper": place @ REST, **parts}


REST = np.linalg.inv(_hop(0.0)[0])


# --- surroundings -------------------------------------------------------------------------------------------------


def _ground() -> Shape:
    hills = union(
        egg((0, -6.0, -1), (19, 6.0, 13)).material(GRASS),
        egg((-7.5, -2.2, -7), (6, 3.9, 5)).material(MEADOW),
        egg((7.5, -2.6, -9), (7, 4.6, 5)).material(MEADOW),
        egg((1.5, -3.0, -14), (10, 5.4, 5)).material(GRASS),
        egg((4.2, -0.9, 1.8), (2.2, 1.15, 1.8)).material(MEADOW),
        smooth=1.0,
    )
    return intersection(hills, box((40, 8, 32)).at(0, 0, -6))


def _mountains() -> Shape:
    near = [egg((-16, -5, -30), (13, 11.5, 8)), egg((-2, -6, -34), (12, 14, 8)), egg((15, -5, -32), (14, 11, 8))]
    far = [egg((-30, -8, -52), (18, 21, 8)), egg((8, -8, -56), (20, 24, 8)), egg((36, -8, -50), (18, 18, 8))]
    return intersection(
        union(
            union(*near, smooth=2.0).material(FAR),
            union(*far, smooth=2.0).material(FARTHER),
        ),
        box((140, 30, 60)).at(0, 6, -42),
    )


def _tree(at: tuple[float, float, float], size: float, crown: int, random: np.random.Generator) -> Shape:
    trunk = union(
        *strand([(0, -0.3, 0), (0.04, 0.5, 0), (-0.02, 1.15, 0.02)], (0.2, 0.13, 0.1), 3),
        limb((0, 0.85, 0), (0.3, 1.4, 0.05), 0.07, 0.05),
        smooth=0.08,
    ).material(BARK)
    balls = [ball((0, 1.75, 0), 0.62)]
    for k in range(5):
        angle = 2 * math.pi * k / 5 + random.uniform(-0.3, 0.3)
        reach = random.uniform(0.42, 0.55)
        y = 1.5 + random.uniform(-0.1, 0.25)
        balls.append(ball((reach * math.cos(angle), y, reach * math.sin(angle)), random.uniform(0.36, 0.46)))
    crowns = union(*balls, smooth=0.16).material(CROWNS[crown])
    return union(trunk, crowns).scale(size).at(*at)


def _toadstool(at: tuple[float, float, float], size: float) -> Shape:
    cap = egg((0, 0.5, 0), (0.36, 0.27, 0.36)) - egg((0, 0.33, 0), (0.42, 0.18, 0.42))
    dots = [
        egg((0.35 * math.cos(a) * c, 0.5 + 0.262 * s, 0.35 * math.sin(a) * c), (0.06, 0.045, 0.06))
        for a, c, s in (
            (0.4, 0.75, 0.66),
            (1.7, 0.8, 0.6),
            (2.9, 0.72, 0.69),
            (4.1, 0.8, 0.6),
            (5.3, 0.75, 0.66),
            (1.1, 0.2, 0.98),
        )
    ]
    stem = union(*strand([(0, -0.1, 0), (0.02, 0.2, 0), (0, 0.48, 0)], (0.14, 0.1, 0.09), 2), smooth=0.04)
    return union(cap.material(CAP), *(d.material(STEM) for d in dots), stem.material(STEM)).scale(size).at(*at)


def _flower(at: tuple[float, float, float], color: int, turn: float, size: float = 1.0) -> Shape:
    stem = union(*strand([(0, -0.08, 0), (0.03, 0.16, 0), (0, 0.34, 0.02)], (0.02, 0.016), 2)).material(CROWNS[1])
    leaf = egg((0.07, 0.1, 0), (0.075, 0.02, 0.035), spin(0, 0, 35)).material(CROWNS[1])
    petals = [
        egg((0.09, 0, 0), (0.075, 0.022, 0.05)).transform(spin(0, 72.0 * k)).material(PETALS[color]) for k in range(5)
    ]
    head = union(*petals, egg((0, 0.02, 0), (0.05, 0.035, 0.05)).material(YOLK)).transform(spin(38)).at(0, 0.36, 0.03)
    return union(stem, leaf, head).transform(spin(0, turn)).scale(size).at(*at)


def _rocks() -> Shape:
    return union(
        egg((1.75, 0.02, -0.95), (0.55, 0.42, 0.45), spin(10, 30, 14)),
        egg((2.3, -0.05, -0.6), (0.36, 0.3, 0.32), spin(0, 60, -20)),
        egg((1.45, -0.08, -0.45), (0.22, 0.18, 0.2)),
        smooth=0.1,
    ).material(ROCK)


def _stones() -> Shape:
    """Flat stones of a path that winds up the hill."""
    places = [(-1.2, 3.6), (-0.75, 2.75), (0.05, 2.1), (0.3, 1.15), (-0.15, 0.3)]
    return union(
        *(egg((x, _floor(x, z), z), (0.42 - 0.02 * i, 0.07, 0.3), spin(0, 40 * i)) for i, (x, z) in enumerate(places))
    ).material(PATH)


def _floor(x: float, z: float) -> float:
    """About how high the hilltop is."""
    return -6.0 + 6.0 * math.sqrt(max(0.0, 1 - (x / 19) ** 2 - ((z + 1) / 13) ** 2))


def _props(random: np.random.Generator) -> Shape:
    trees = [
        _tree((-2.9, _floor(-2.9, -1.9), -1.9), 1.25, 0, random),
        _tree((-4.4, _floor(-4.4, -3.6) + 0.25, -3.6), 1.5, 1, random),
        _tree((3.5, _floor(3.5, -3.4) + 0.05, -3.4), 1.3, 2, random),
        _tree((5.6, 0.55, -5.8), 1.7, 1, random),
    ]
    toadstools = [
        _toadstool((-1.75, _floor(-1.75, 0.9), 0.9), 1.25),
        _toadstool((-2.3, _floor(-2.3, 0.5), 0.5), 0.8),
        _toadstool((2.0, _floor(2.0, 0.45), 0.45), 0.7),
    ]
    flowers = []
    for k, (x, z) in enumerate(
        [(-1.3, 1.9), (-2.1, 2.1), (1.2, 1.8), (1.7, 1.3), (1.05, 2.5), (-2.9, 1.1), (2.5, 0.9), (-0.9, -0.9)]
    ):
        turn, size = random.uniform(-40, 40), random.uniform(0.95, 1.3)
        flowers.append(_flower((x, _floor(x, z), z), k % 3, turn, size))
    return union(*trees, *toadstools, *flowers, _rocks(), _stones())


def _cloud(at: tuple[float, float, float], size: float) -> Shape:
    puffs = [
        ((0, 0, 0), 0.8),
        ((-0.9, -0.15, 0.1), 0.6),
        ((0.95, -0.1, 0), 0.65),
        ((0.4, 0.45, -0.1), 0.6),
        ((1.6, -0.25, 0.1), 0.4),
        ((-1.55, -0.25, 0), 0.4),
    ]
    return union(*(ball(p, r) for p, r in puffs), smooth=0.3).scale((size, 0.8 * size, 0.8 * size)).at(*at)


def jumper(*, lights: int = 1, seed: int = 0) -> Scene:
    """A creature hops around a hilltop among trees, toadstools and flowers, under clouds; animated.

    Args:
        lights: 1 to 32 directional lights; the first is the sun.
        seed: of the trees' crowns and the flowers.

    Raises:
        ParameterError: an option is not a whole number in range.
    """
    options = Options(lights, seed)
    random = np.random.default_rng(options.seed)
    clouds = union(
        _cloud((-7.5, 6.6, -20), 1.5),
        _cloud((6.5, 8.0, -24), 1.9),
        _cloud((0.5, 8.6, -32), 1.6),
        _cloud((-17, 11.5, -30), 2.4),
    )
    return Scene(
        implicits=(
            Implicit(creature(), rows(_hop(0.0)[0]), FUR, "jumper"),
            Implicit(_ground(), material=GRASS, name="ground"),
            Implicit(_props(random), material=ROCK, name="props"),
            Implicit(nearer(_mountains(), EYE, 0.6), material=FAR, name="mountains"),
            Implicit(nearer(clouds, EYE, 0.6), material=CLOUD, name="clouds"),
        ),
        lights=suns(options.lights, SUN, 7.5, (1.0, 0.9, 0.74), (30, 60), 200),
        camera=Camera(EYE, (0.08, 1.5, 0), fov=math.radians(38), exposure=0.0),
        background=(0.26, 0.56, 1.0),
        ambient=(0.30, 0.42, 0.60),
        name="jumper",
        motion=motion,
    )
