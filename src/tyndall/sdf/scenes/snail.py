"""`snail`: a snail crosses a mossy stone after the rain, among toadstools, a fallen leaf and dew.

Its shell is a logarithmic spiral (Moseley 1838): the tube's distance from the axis and its radius shrink by
:data:`WHORL` with every turn inwards.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from tyndall.scene.bundled.sunlight import Options, suns
from tyndall.scene.model import Camera, Implicit, Material, Scene
from tyndall.sdf.scenes.parts import about, ball, curve, egg, limb, nearer, paint, spin, strand
from tyndall.sdf.shape import Floats, Shape, intersection, union
from tyndall.sdf.solids import box, torus

VIEWER = (1.9, 2.35, 9.2)
SUN = (0.46, -0.66, -0.50)
WHORL = 0.47  # of the size a turn further out
TURNS = 3.1
PIECES = 16  # of the outermost turn; smaller turns have fewer
SHELL = (-0.5, 1.72, 0.0)  # m, middle of the shell

SKIN = paint("#d9a677", 0.42)
PALE = paint("#eac9a0", 0.45)
FOOT = paint("#b98560", 0.35)
EYE = paint("#1d1512", 0.12)
SHINE = paint("#ffffff", 0.4, glow=1.4)
BANDS = tuple(paint(c, 0.28) for c in ("#7c3318", "#96441f", "#ad5a28", "#c17436", "#d08d4a", "#dca765"))
STRIPE = paint("#4e2214", 0.28)
LIP = paint("#f0d9b2", 0.35)
STONE = paint("#77786f", 0.9)
MOSS = paint("#6d8f2c", 1.0)
MOSS_DARK = paint("#4c6d26", 1.0)
LEAF = paint("#d9762b", 0.6)
LEAF_VEIN = paint("#f0b45a", 0.6)
GREEN = paint("#5f9e37", 0.55)
GREEN_DARK = paint("#3d7a32", 0.6)
CAP = paint("#c9402f", 0.3)
CREAM = paint("#f4e7cf", 0.7)
GILLS = paint("#e2cba6", 0.8)
DEW = paint("#dff2ff", 0.04)
GLOW = tuple(
    Material("glow", (0.0, 0.0, 0.0, 1.0), roughness=1.0, emissive=c)
    for c in ((0.055, 0.12, 0.05), (0.16, 0.2, 0.07), (0.04, 0.11, 0.07), (0.22, 0.19, 0.08))
)


POSE = spin(12, 14, 10) @ np.diag([1.14, 1.14, 1.14, 1.0])
POSE[:3, 3] = SHELL


def whorl(turn: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Centres (N, 3), radii (N,) and outward directions (N, 3) of the shell's tube after so many turns inwards.

    The outermost end, at 0, is the mouth of the shell, below and in front; the apex stands out along +Z.
    """
    t = np.asarray(turn, np.float64)
    size = WHORL**t
    angle = -0.95 + 2 * math.pi * t
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    centres = 1.02 * size[:, None] * out
    centres[:, 2] = 0.62 * (1 - size)
    return centres, 0.43 * size, out


def _along(first: float, last: float) -> Floats:
    """Turns inwards at which the pieces of a spiral meet: fewer to a turn as it gets smaller."""
    rate = -0.3 * math.log(WHORL)
    low, high = -math.expm1(-rate * first) / rate, -math.expm1(-rate * last) / rate
    steps = np.linspace(low, high, round(PIECES * (high - low)) + 1)
    return np.asarray(-np.log1p(-rate * steps) / rate)


def _shell() -> Shape:
    turns = _along(0, TURNS)
    centres, radii, _ = whorl(turns)
    tube: list[Shape] = []
    for i in range(len(turns) - 1):
        shade = min(len(BANDS) - 1, int(len(BANDS) * (1 - turns[i] / TURNS)))
        piece = limb(centres[i], centres[i + 1], float(radii[i]), float(radii[i + 1]))
        tube.append(piece.material(BANDS[shade]))
    tube.append(ball((0, 0, centres[-1, 2]), 0.08).material(BANDS[0]))
    stripes: list[Shape] = []
    for lift, size, last in ((0.5, 0.105, 1.7), (-0.25, 0.07, 1.2), (1.05, 0.07, 1.7)):
        along = _along(0.02, last)
        middle, radius, outward = whorl(along)
        way = math.cos(lift) * outward + math.sin(lift) * np.array([0, 0, 1.0])
        places = middle + (0.955 * radius)[:, None] * way
        stripes += [
            limb(places[i], places[i + 1], float(size * radius[i] / 0.43), float(size * radius[i + 1] / 0.43))
            for i in range(len(along) - 1)
        ]
    mouth, wide, _ = whorl([0.0])
    forward = (math.sin(0.95), math.cos(0.95), 0.0)
    lip = torus(float(wide[0]) * 0.97, 0.075).orient(forward).at(*mouth[0]).material(LIP)
    whole = union(union(*tube, smooth=0.03), union(*stripes).material(STRIPE), lip, smooth=0.02)
    drops = []
    for turn, lift, size in (
        (0.19, 0.7, 0.07),
        (0.3, 1.0, 0.055),
        (0.42, 0.5, 0.08),
        (1.24, 0.9, 0.05),
        (0.08, 0.8, 0.05),
    ):
        middle, radius, outward = whorl([turn])
        way = math.cos(lift) * outward[0] + math.sin(lift) * np.array([0, 0, 1.0])
        drops.append(ball(POSE[:3, :3] @ (middle[0] + radius[0] * way) + POSE[:3, 3], size))
    return union(whole.transform(POSE), union(*drops).material(DEW))


def _skin(random: np.random.Generator) -> Shape:
    """Foot, neck and head; the sole is at about y = 0."""
    foot = [
        *strand(
            [(-3.05, 0.1, -0.1), (-2.2, 0.22, 0.0), (-1.0, 0.4, 0.04), (0.6, 0.42, 0.0), (1.7, 0.42, 0.02)],
            (0.05, 0.2, 0.42, 0.5, 0.42),
            7,
        ),
        *strand(
            [(1.2, 0.4, 0.02), (2.0, 0.62, 0.02), (2.42, 1.05, 0.04), (2.72, 1.35, 0.06)], (0.46, 0.43, 0.37, 0.33), 5
        ),
        egg((0.35, 0.75, 0.02), (0.95, 0.5, 0.5)),
        egg((2.83, 1.38, 0.07), (0.42, 0.34, 0.34), spin(0, 0, 14)),
    ]
    muzzle = [egg((3.06, 1.22, 0.2), (0.17, 0.15, 0.15)), egg((3.06, 1.22, -0.06), (0.17, 0.15, 0.15))]
    skirt = []
    for side in (-1, 1):
        edge = curve(
            [(-2.9, 0.03, side * 0.1), (-1.4, 0.06, side * 0.56), (0.3, 0.06, side * 0.74), (1.9, 0.06, side * 0.5)], 20
        )
        wave = [0.09 + 0.05 * (k % 2) for k in range(len(edge))]
        skirt += [limb(edge[k], edge[k + 1], wave[k], wave[k + 1]) for k in range(len(edge) - 1)]
    warts = []
    spine = curve([(0.95, 0.62, 0.02), (1.6, 0.68, 0.02), (2.1, 0.9, 0.03), (2.45, 1.2, 0.05)], 9)
    for i, p in enumerate(spine):
        for side in (-1, 1):
            angle = random.uniform(0.25, 1.25) * side
            warts.append(
                ball(
                    p + 0.37 * np.array([-0.25 * (i > 4), 0.35 * math.cos(angle), math.sin(angle)]),
                    random.uniform(0.06, 0.1),
                )
            )
    body = union(*foot, smooth=0.16).material(SKIN)
    return union(
        body,
        union(*skirt).material(FOOT),
        union(*warts).material(PALE),
        union(*muzzle, smooth=0.05).material(PALE),
        smooth=0.09,
    )


EYES = {"left eye": (2.86, 1.6, -0.14), "right eye": (2.82, 1.6, 0.28)}


def _stalk(side: int) -> Shape:
    top = np.array([0.28 + 0.2 * side, 1.06 - 0.1 * side, 0.24 * side])
    stalk = strand(
        [np.array([0, -0.1, 0]), 0.3 * top + [0, 0.08, 0], 0.7 * top + [-0.02, 0.03, 0], top], (0.13, 0.085, 0.085), 4
    )
    knob = egg(top + [0.02, 0.05, 0], (0.155, 0.165, 0.155))
    pupil = ball(top + [0.07, 0.07, 0.06], 0.115)
    shine = ball(top + [0.1, 0.14, 0.15], 0.03)
    return union(
        union(*stalk, knob, smooth=0.06).material(SKIN), pupil.material(EYE), shine.material(SHINE), smooth=0.012
    )


def _feeler(side: int) -> Shape:
    path = [(3.05, 1.2, 0.07 + 0.15 * side), (3.3, 1.08, 0.07 + 0.24 * side), (3.46, 0.98, 0.07 + 0.3 * side)]
    return union(*strand(path, (0.07, 0.045), 2), ball(path[-1], 0.06), smooth=0.03).material(PALE)


def _body(random: np.random.Generator) -> Shape:
    """The snail without its shell and its eyes, which stand in collars."""
    collars = [ball(at, 0.125).material(SKIN) for at in EYES.values()]
    smile = strand([(3.14, 1.12, 0.28), (3.24, 1.09, 0.07), (3.14, 1.14, -0.12)], (0.018, 0.022, 0.018), 3)
    return union(union(_skin(random), *collars, _feeler(1), _feeler(-1), smooth=0.05), union(*smile).material(EYE))


def creature(random: np.random.Generator) -> tuple[Implicit, ...]:
    """The snail, in parts that move by themselves: so nothing is pruned again for them."""
    eyes = (
        Implicit(_stalk(-1 if name == "left eye" else 1).at(*EYES[name]), material=SKIN, name=name) for name in EYES
    )
    return (
        Implicit(_body(random), material=SKIN, name="snail"),
        Implicit(_shell(), material=BANDS[0], name="shell"),
        *eyes,
    )


def motion(time: float) -> Mapping[str, ArrayLike]:
    """Matrices of the snail and its eyes at a time in seconds: it creeps to and fro, and looks around."""
    place = np.eye(4)
    place[0, 3] = 0.35 * math.sin(0.4 * time)
    result: dict[str, ArrayLike] = {"snail": place, "shell": place}
    for side, (name, at) in zip((-1, 1), EYES.items(), strict=True):
        sway = 9 * math.sin(1.3 * time + 0.7 * side) - 9 * math.sin(0.7 * side)
        nod = 8 * math.sin(0.9 * time + 1.1 * side) - 8 * math.sin(1.1 * side)
        result[name] = place @ about(at, spin(sway, 0, nod))
    return result


# --- surroundings -------------------------------------------------------------------------------------------------


def _top(x: float, z: float) -> float:
    """About how high the stone is."""
    return -3.0 + 3.0 * math.sqrt(max(0.0, 1 - (x / 8.0) ** 2 - (z / 5.5) ** 2))


def _stone(random: np.random.Generator) -> Shape:
    rock = union(
        egg((0, -3.0, 0), (8.0, 3.0, 5.5)),
        egg((5.2, -2.6, 1.8), (3.0, 2.2, 2.4), spin(0, 20, 8)),
        egg((-5.6, -2.8, 1.2), (3.2, 2.5, 2.6), spin(0, -20, -6)),
        egg((-3.0, -2.2, -4.2), (3.6, 2.6, 2.4)),
        smooth=0.4,
    ).material(STONE)
    moss: list[Shape] = []
    for k in range(64):
        x, z = random.uniform(-6.2, 6.2), random.uniform(-2.2, 3.9)
        size = random.uniform(0.3, 0.75)
        ground = _top(x, z)
        if ground < -2.2:
            continue
        high = size * random.uniform(0.24, 0.4)
        radius = 0.5 * (size**2 / high + high)  # of a ball that stands out so far, so wide
        moss.append(ball((x, ground - 0.03 + high - radius, z), radius).material(MOSS if k % 3 else MOSS_DARK))
    return intersection(union(rock, union(*moss), smooth=0.07), box((18, 5, 13)).at(0, -1.5, 0))


def _toadstool(at: Sequence[float], size: float, lean: float) -> Shape:
    cap = ball((0, 0.763, 0), 0.657).material(CAP) - ball((0, -1.78, 0), 2.78).material(GILLS)
    dots = []
    for k in range(9):
        around, high = 2.4 * k, 0.45 + 0.52 * ((k * 0.618) % 1)
        flat = math.sqrt(1 - high * high)
        dots.append(ball((0.62 * flat * math.cos(around), 0.763 + 0.62 * high, 0.62 * flat * math.sin(around)), 0.08))
    stem = strand([(0, -0.3, 0), (0.05, 0.4, 0), (0, 0.95, 0)], (0.2, 0.14, 0.12), 3)
    ring = torus(0.14, 0.035).orient((0, 1, 0)).at(0.02, 0.66, 0)
    return (
        union(
            cap,
            union(*dots).material(CREAM),
            union(*stem, ring, smooth=0.03).material(CREAM),
        )
        .transform(spin(0, 0, lean))
        .scale(size)
        .at(*at)
    )


def _fallen_leaf() -> Shape:
    """A pointed leaf, a little bent: what two balls have in common, with its veins."""
    blade = intersection(
        ball((0, 0, 1.52), 2.15),
        ball((0, 0, -1.52), 2.15),
        ball((0, -4.0, 0), 4.06),
    ) - ball((0, -4.0, 0), 4.0)
    ribs = strand(
        [(-1.9, -0.35, 0), (-0.8, 0.0, 0), (0, 0.07, 0), (0.8, 0.0, 0), (1.4, -0.18, 0)], (0.05, 0.04, 0.02), 6
    )
    for k in range(5):
        x = -0.8 + 0.38 * k
        for side in (-1, 1):
            reach = 0.46 * math.sqrt(max(0.05, 1 - (x / 1.5) ** 2))
            a, b = (x, 0.065 - x * x / 8, 0), (x + 0.3, 0.06 - ((x + 0.3) ** 2 + reach**2) / 8, side * reach)
            ribs.append(limb(a, b, 0.024, 0.012))
    return union(blade.material(LEAF), union(*ribs).material(LEAF_VEIN))


def _grass(random: np.random.Generator) -> Shape:
    blades: list[Shape] = []
    for k in range(15):
        x = random.uniform(-5.4, 4.9)
        z = random.uniform(-2.9, -1.5) if k % 4 else random.uniform(2.2, 2.6)
        tall = random.uniform(1.4, 3.0) * (1 if z < 0 else 0.45)
        lean, turn = random.uniform(0.3, 0.9) * tall, random.uniform(0, 2 * math.pi)
        foot = np.array([x, _top(x, z) - 0.15, z])
        way = np.array([math.cos(turn), 0, 0.4 * math.sin(turn)])
        path = [
            foot,
            foot + [0, 0.55 * tall, 0] + 0.2 * lean * way,
            foot + [0, 0.9 * tall, 0] + 0.6 * lean * way,
            foot + [0, tall, 0] + 1.1 * lean * way,
        ]
        blades.append(union(*strand(path, (0.075, 0.065, 0.05, 0.012), 5)).material((GREEN, GREEN_DARK)[k % 2]))
    return union(*blades)


def _clover(at: Sequence[float], size: float, turn: float) -> Shape:
    stem = strand([(0, -0.1, 0), (0.05, 0.4, 0), (0, 0.8, 0.03)], (0.035, 0.028), 3)
    leaves = []
    for k in range(3):
        heart = union(
            egg((0.24, 0, 0.11), (0.22, 0.035, 0.16), spin(0, 18)),
            egg((0.24, 0, -0.11), (0.22, 0.035, 0.16), spin(0, -18)),
            smooth=0.02,
        )
        leaves.append(heart.transform(spin(0, 120.0 * k, 14)))
    top = union(*leaves).transform(spin(16)).at(0, 0.8, 0.03)
    return union(union(*stem).material(GREEN_DARK), top.material(GREEN)).transform(spin(0, turn)).scale(size).at(*at)


def _garden(random: np.random.Generator) -> Shape:
    clover = []
    for x, z, size in ((-2.9, 2.3, 1.15), (-3.9, 1.9, 1.4), (3.9, 1.5, 1.0), (4.6, 0.9, 1.25), (1.2, 2.7, 0.75)):
        clover.append(_clover((x, _top(x, z), z), size, random.uniform(0, 120)))
    leaf = _fallen_leaf().transform(spin(22, 28, -4)).at(0.9, _top(0.9, 2.0) + 0.22, 2.15)
    drops = []
    for _ in range(26):
        x, z = random.uniform(-4.6, 4.6), random.uniform(1.0, 3.0)
        drops.append(ball((x, _top(x, z) + random.uniform(0.13, 0.2), z), random.uniform(0.04, 0.1)))
    beads = [(0.3, 0.14, 0.25), (1.05, -0.02, -0.2), (-0.55, 0.1, 0.28)]
    place = np.array([0.9, _top(0.9, 2.0) + 0.22, 2.15])
    drops += [egg(place + b, (0.1, 0.08, 0.1)) for b in beads]
    return union(
        _toadstool((-4.3, _top(-4.3, -0.9) + 0.05, -0.9), 1.9, 7),
        _toadstool((-5.2, _top(-5.2, 0.1) + 0.05, 0.1), 1.15, -9),
        _toadstool((-3.4, _top(-3.4, 0.9), 0.95), 0.62, -6),
        _toadstool((4.9, _top(4.9, -1.0), -1.0), 1.3, -10),
        _grass(random),
        *clover,
        leaf,
        union(*drops).material(DEW),
    )


def _distance(random: np.random.Generator) -> Shape:
    """Balls of light far behind: discs, as a lens out of focus makes them."""
    discs = []
    for k in range(18):
        x, y = random.uniform(-19, 19), random.uniform(-5, 12)
        size = random.uniform(0.7, 1.9)
        discs.append(ball((x, y, -26 + random.uniform(-2, 2)), size).material(GLOW[k % len(GLOW)]))
    return union(*discs)


def snail(*, lights: int = 1, seed: int = 0) -> Scene:
    """A snail with a spiral shell on a mossy stone, with toadstools, clover, a fallen leaf and dew; animated.

    Args:
        lights: 1 to 32 directional lights; the first is the sun.
        seed: of moss, grass, dew and the lights behind.

    Raises:
        ParameterError: an option is not a whole number in range.
    """
    options = Options(lights, seed)
    random = np.random.default_rng(options.seed)
    return Scene(
        implicits=(
            *creature(random),
            Implicit(_stone(random), material=STONE, name="stone"),
            Implicit(_garden(random), material=GREEN, name="garden"),
            Implicit(nearer(_distance(random), VIEWER, 0.55), material=GLOW[0], name="distance"),
        ),
        lights=suns(options.lights, SUN, 8.0, (1.0, 0.88, 0.68), (30, 60), 220),
        camera=Camera(VIEWER, (-0.15, 1.4, 0), fov=math.radians(37), exposure=0.0),
        background=(0.035, 0.085, 0.045),
        ambient=(0.22, 0.30, 0.22),
        name="snail",
        motion=motion,
        room=((-4.0, -0.5, -1.6), (4.6, 3.4, 1.6)),
    )
