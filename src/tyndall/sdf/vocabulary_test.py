"""Every node keeps its word: the same value on the device, its Lipschitz bound, its box, what it says of exactness.

The table :data:`CASES` holds each class at least once; all tests run over all of it. What is asked of random places is
exact: where values change by no more than the distance (the bound) and a step of |f| down the gradient ends on the
surface, |f| is the distance.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import props
import pytest

from tyndall import sdf
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, fields_of
from tyndall.scene.model import Implicit, Material, Volume
from tyndall.sdf import X, Y, Z
from tyndall.sdf.modifiers import Bend, Displace, Elongate, Extrude, Mirror, Noise, Revolve, Round, Shell, Twist
from tyndall.sdf.profiles import PROFILES
from tyndall.sdf.program import TURNED, Kinds, compile_shape
from tyndall.sdf.repetition import Cell, MirroredForever, Polar, Repeated, RepeatedForever, Repetition
from tyndall.sdf.shape import MOST_DEEP, Combination, Floats, Modifier, Named, Painted, Primitive, Shape, Transformed
from tyndall.sdf.solids import SOLIDS

MODIFIERS = (
    Bend, Cell, Displace, Elongate, Extrude, Mirror, MirroredForever, Noise, Revolve, Round, Shell, Twist,
)  # fmt: skip
REPETITIONS = (Repeated, RepeatedForever, Polar)

_bar, _egg = sdf.box((1.2, 0.3, 0.4)), sdf.egg(0.4, 0.2)
_off = sdf.sphere(0.3).at(0.3, 0.2, -0.1)
CASES: dict[str, Shape] = {
    **{f"{name}()": cls() for name, cls in SOLIDS.items()},
    **{f"{name}()": cls() for name, cls in PROFILES.items()},
    "sphere, small": sdf.sphere(0.3),
    "box, thin": sdf.box((1.4, 0.7, 0.1)),
    "plane, tilted": sdf.plane((1, 2, -2), 0.4),
    "plane, down": sdf.plane((0, 0, -3), 0.4),
    "torus, spindle": sdf.torus(0.3, 0.5),
    "capsule, across": sdf.capsule((-0.5, 0.2, 0.1), (0.4, -0.3, 0.6), 0.2),
    "capsule, a ball": sdf.capsule((0.1, 0.2, 0.3), (0.1, 0.2, 0.3), 0.4),
    "cone, cut": sdf.cone(0.9, 0.7, 0.3),
    "cone, upside down": sdf.cone(0.0, 1.3, 0.6),
    "capped cone, across": sdf.capped_cone((0.5, 0.2, -0.4), (-0.5, 0.1, 0.5), 0.1, 0.6),
    "round cone, across": sdf.round_cone((0.5, 0.2, -0.4), (-0.5, 0.1, 0.5), 0.1, 0.6),
    "ellipsoid, needle": sdf.ellipsoid((0.1, 1.2, 0.1)),
    "ellipsoid, disc": sdf.ellipsoid((1.1, 0.15, 0.8)),
    "ellipsoid, sheet": sdf.ellipsoid((1.2, 0.03, 1.0)),
    "ellipse, needle": sdf.ellipse((0.1, 1.2)),
    "rounded box, flat": sdf.rounded_box((1.2, 0.8, 0.3), 0.15),
    "frame, flat": sdf.box_frame((1.2, 0.8, 0.3), 0.06),
    "capped torus, short": sdf.capped_torus(0.8, 0.2, 0.5),
    "capped torus, long": sdf.capped_torus(0.8, 0.2, 2.9),
    "cone without end, half": sdf.infinite_cone(math.pi / 2),
    "solid angle, wide": sdf.solid_angle(2.4, 0.8),
    "cut sphere, little": sdf.cut_sphere(1, 0.6),
    "cut sphere, much": sdf.cut_sphere(1, -0.6),
    "bowl, low": sdf.cut_hollow_sphere(1, -0.5, 0.2),
    "bowl, high": sdf.cut_hollow_sphere(1, 0.7, 0.2),
    "death star, great bite": sdf.death_star(0.7, 1.1, 0.6),
    "pyramid, steep": sdf.pyramid(0.5, 1.4),
    "pyramid, flat": sdf.pyramid(1.6, 0.3),
    "rhombic prism, steep": sdf.rhombic_prism((0.4, 1.4), 0.9),
    "wedge, flat": sdf.wedge((1.2, 0.4, 0.8)),
    "vesica, across": sdf.vesica((0.5, 0.6, -0.4), (-0.5, 0.1, 0.5), 0.2),
    "tube, in space": sdf.tube((0.5, 0.2, -0.4), (0.3, 0.9, 0.8), (-0.6, -0.3, 0.2), 0.1),
    "tube, straight": sdf.tube((0.5, 0.2, -0.4), (0.1, 0.2, -0.4), (-0.3, 0.2, -0.4), 0.1),
    "tube, folded": sdf.tube((0, 0, 0), (1, 0.01, 0), (0, 0.02, 0), 0.1),
    "gyroid, fine": sdf.gyroid(0.6, 0.1),
    "rounded rectangle, each": sdf.rounded_rectangle((1.2, 0.8), (0.1, 0.2, 0.3, 0.0)),
    "bar, across": sdf.bar((-0.4, -0.5), (0.6, 0.3), 0.3),
    "segment, across": sdf.segment((-0.4, -0.5), (0.6, 0.3), 0.15),
    "uneven capsule, up": sdf.uneven_capsule(0.2, 0.4, 0.7),
    "trapezoid, tip": sdf.trapezoid(0.0, 1.1, 0.9),
    "parallelogram, left": sdf.parallelogram(0.6, 1.0, -0.8),
    "triangle, right": sdf.polygon((-0.5, -0.4), (0.2, 0.8), (0.7, -0.3)),
    "triangle, left": sdf.polygon((-0.5, -0.4), (0.7, -0.3), (0.2, 0.8)),
    "isosceles, up": sdf.isosceles(0.6, 1.1),
    "quad, dart": sdf.polygon((-0.6, -0.5), (0.0, -0.1), (0.6, -0.5), (0.0, 0.8)),
    "triangle": sdf.triangle(0.8),
    "hexagon": sdf.hexagon(0.8),
    "octagon": sdf.octagon(0.8),
    "star, many": sdf.star(13, 1.0, 0.8),
    "star, two": sdf.star(2, 1.0, 0.3),
    "pie, wide": sdf.pie(2.5, 0.7),
    "cut disk, much": sdf.cut_disk(0.9, -0.4),
    "cut disk, little": sdf.cut_disk(0.9, 0.5),
    "arc, short": sdf.arc(0.4, 0.9, 0.3),
    "horseshoe, short": sdf.horseshoe(0.9, 0.7, 0.4, 0.2),
    "horseshoe, stubby": sdf.horseshoe(0.8, 0.7, 0.05, 0.9),
    "horseshoe, crossed": sdf.horseshoe(2.9, 0.3, 0.6, 0.1),
    "horseshoe, long": sdf.horseshoe(2.6, 0.7, 0.2, 0.2),
    "moon, thin": sdf.moon(1.0, 0.9, 0.3),
    "moon, great bite": sdf.moon(0.7, 1.1, 0.6),
    "heart, great": sdf.heart(1.4),
    "plus, thick": sdf.cross(1.6, 0.9),
    "half plane, tilted": sdf.half_plane((2, -1), 0.3),
    "half plane, left": sdf.half_plane((-2, 0), 0.3),
    "curve, folded": sdf.curve((0, 0), (1, 0.1), (0, 0.3), 0.1),
    # --- modifiers ---
    "extruded": sdf.star(5, 0.9, 0.5).extrude(0.4),
    "extruded, outside": sdf.ellipse((0.8, 0.3)).extrude(0.4),
    "revolved": sdf.rectangle((0.3, 0.6)).revolve(0.8),
    "revolved, across": _egg.revolve(),
    "revolved, inwards": sdf.circle(0.3).at(1.0, 0.2).revolve(-0.2),
    "rounded": sdf.box(0.8).round(0.2),
    "rounded, flat": sdf.star().round(0.1),
    "shell": sdf.octahedron(0.8).shell(0.1),
    "shell, outside": sdf.ellipsoid().shell(0.1),
    "elongated": sdf.torus(0.4, 0.15).elongate(0.5, 0.3, 0.1),
    "elongated, aside": sdf.sphere(0.3).at(0.5, -0.5, 0).elongate(0.5, 0.3),
    "displaced": sdf.sphere(0.8).displace(0.05, 0.6),
    "noisy": sdf.sphere(0.8).noise(0.1, 0.5, 7),
    "noisy, finely": sdf.box(1.1).noise(0.06, 0.4, 65535, 4),
    "twisted": _bar.orient(X).twist(2.5),
    "twisted, off": _off.twist(-3),
    "twisted little": sdf.box((0.5, 0.5, 1.5)).twist(0.5),
    "bent": _bar.bend(0.9),
    "bent, off": _off.bend(-2),
    "mirrored": _off.mirror("x"),
    "mirrored, thrice": _off.mirror("xyz"),
    "mirrored, whole": sdf.sphere(0.3).at(0.6, 0.5).mirror("xy"),
    "mirrored, flat": sdf.circle(0.3).at(0.6, 0.5).mirror("xy"),
    # --- repetitions ---
    "repeated": sdf.octahedron(0.3).repeat(0.7, (3, 2, 1)),
    "repeated, flat": sdf.star(5, 0.3, 0.1).repeat(0.7, 3),
    "repeated forever": sdf.sphere(0.3).at(0.1, 0.05).repeat(0.9),
    "repeated forever, one axis": sdf.torus(0.5, 0.2).repeat((0.0, 1.6, 0.0)),
    "repeated forever, overlapping": sdf.box(0.8).rotate(0.5).repeat((0.7, 0.0, 1.0)),
    "repeated forever, twisted": sdf.box((0.3, 0.2, 0.5)).twist(3).repeat(0.8),
    "repeated forever, flat": sdf.egg(0.3, 0.1).repeat(1.0),
    "repeated, mirrored": sdf.cone(0.3, 0.5).at(0.1, 0.1, 0.1).repeat(1.0, mirrored=True),
    "repeated, mirrored, cut": sdf.cone(0.5, 0.9).orient(X).repeat((0.7, 0, 0.8), mirrored=True),
    "polar": sdf.box((0.5, 0.1, 0.3)).at(0.7).polar(5),
    "polar, across": sdf.cone(0.2, 0.5).at(0.7).polar(7, (1, 1, 0)),
    "polar, flat": sdf.circle(0.2).at(0.7).polar(6),
    # --- transforms and the rest ---
    "moved": sdf.dodecahedron(0.5).at(0.3, -0.2, 0.4),
    "turned": sdf.box((1.2, 0.3, 0.4)).rotate(0.7, (1, 2, 3)),
    "stretched": sdf.sphere(0.5).scale((1, 2, 0.5)),
    "enlarged": sdf.pyramid(0.7, 0.6).scale(1.7).at(0.2),
    "flat, turned": sdf.heart(0.8).rotate(0.5).scale(1.2).at(0.1, -0.3),
    "painted": sdf.cone(0.5).material(Material("red", (1, 0, 0, 1))),
    "named": sdf.link(0.3, 0.4, 0.1).named("part"),
}
for _operation in (sdf.union, sdf.intersection, sdf.subtraction):
    _apart = 0.7 if _operation is sdf.subtraction else 0.1
    _three = sdf.sphere(0.8), sdf.box(1.1).at(_apart, 0.1), sdf.torus(0.6, 0.4).at(0, 2 * _apart)
    CASES[f"{_operation.__name__}, hard"] = _operation(*_three)
    for _blend in ("polynomial", "exponential", "root"):
        CASES[f"{_operation.__name__}, {_blend}"] = _operation(*_three, smooth=0.2, blend=_blend)
EXACT = [name for name, shape in CASES.items() if shape.accuracy != "bound"]
# What a random pair of places is not likely to find: where a bound is reached only far away, or in one place.
LOOSE = {
    "noisy", "noisy, finely", "twisted", "twisted, off", "bent", "bent, off", "repeated forever, twisted", "displaced",
}  # fmt: skip


def places(shape: Shape, count: int, seed: int = 0, margin: float = 0.6) -> Floats:
    """(count, 3) random places in and around a shape's box."""
    low, high = shape.box
    low, high = np.maximum(low, -1.5) - margin, np.minimum(high, 1.5) + margin
    return np.random.default_rng(seed).uniform(low, high, (count, 3))


def gradient(shape: Shape, p: Floats, step: float = 1e-6) -> Floats:
    """Central differences (N, 3)."""
    steps = [np.eye(3)[axis] * step for axis in range(3)]
    return np.stack([(shape.distance(p + s) - shape.distance(p - s)) / (2 * step) for s in steps], axis=1)


def classes(shape: Shape) -> set[type[Shape]]:
    below = {cls for child in shape.children for cls in classes(child)}
    if isinstance(shape, Repetition):
        below |= {cls for child in shape.copies() for cls in classes(child)}
    return {type(shape)} | below


def test_the_table_has_every_class() -> None:
    had = {cls for shape in CASES.values() for cls in classes(shape)}
    wanted = {*SOLIDS.values(), *PROFILES.values(), *MODIFIERS, *REPETITIONS, Combination, Transformed, Painted, Named}
    assert had >= wanted
    assert {cls for cls in had if issubclass(cls, Modifier)} == set(MODIFIERS)


def test_the_catalogue_is_as_large_as_promised() -> None:
    assert len(SOLIDS) >= 30
    assert len(PROFILES) >= 15
    assert sorted(cls.id for cls in SOLIDS.values() if cls.id is not None) == list(range(32))  # S5's ids
    assert [SOLIDS[name].id for name in ("sphere", "cuboid", "cylinder", "plane", "torus")] == [0, 1, 2, 3, 4]


def test_a_name_means_one_thing() -> None:
    """No WESL function twice, no parameter over a method, no more than 8 numbers."""
    codes = [cls.code for cls in (*SOLIDS.values(), *PROFILES.values(), *MODIFIERS)]
    assert len(codes) == len(set(codes))
    for cls in (*SOLIDS.values(), *PROFILES.values(), *MODIFIERS, *REPETITIONS):
        names = {f.name for f in dataclasses.fields(cls)} - {"shape"}
        assert not names & set(vars(Shape)), cls
        assert names == {f.name for f in fields_of(cls)}, cls
    for name, shape in CASES.items():
        if isinstance(shape, (Primitive, Modifier)):
            assert len(shape.numbers) <= 8, name
            assert all(type(x) is float for x in map(float, shape.numbers)), name


@pytest.mark.parametrize("name", [name for name, shape in CASES.items() if isinstance(shape, Primitive)])
def test_a_primitive_is_enlarged_and_turned_by_its_parameters(name: str) -> None:
    shape = CASES[name]
    assert isinstance(shape, Primitive)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    p = places(shape, 300)
    for matrix in (np.eye(3), turn):
        made = shape.similar(matrix, 1.7)
        if made is None:
            assert matrix is turn
            assert shape.places is None
            continue
        assert np.allclose(made(1.7 * p @ matrix.T), 1.7 * shape(p), rtol=1e-9, atol=1e-9)


def test_what_is_enlarged_is_not_turned() -> None:
    """A leaf takes transforms in where its parameters can, and has the same values; a named one keeps its own."""
    shapes = (
        sdf.round_cone().rotate(0.7, (1, 2, 3)).scale(1.5).at(0.1, 0.2),
        sdf.ellipsoid().scale(0.4).at(1),
        sdf.sphere(0.3).rotate(1).scale(3),
    )
    program = compile_shape(sdf.union(*shapes), Kinds())
    assert not (program.words[:, 0] & TURNED).any()
    for leaf, shape in zip(program.leaves, shapes, strict=True):
        p = places(shape, 100)
        assert program.slots[leaf.slot, 3] == pytest.approx(1)
        assert np.allclose(leaf.shape(p - leaf.placement[:3, 3]), shape(p), atol=1e-12)
    kept = sdf.union(sdf.sphere(0.3).scale(2).named("part"), sdf.sphere().scale((1, 1, 2)), sdf.box().rotate(1))
    assert (compile_shape(kept, Kinds()).words[:, 0] & TURNED).all()


# --- the device ---------------------------------------------------------------------------------------------------


def rows(numbers: tuple[float, ...]) -> str:
    padded = [*(float(x) for x in numbers), *[0.0] * 8][:8]
    vectors = (", ".join(repr(x) for x in padded[i : i + 4]) for i in (0, 4))
    return ", ".join(f"vec4f({v})" for v in vectors)


class Writer:
    """A shape as WESL, statement by statement, in the plainest way."""

    def __init__(self) -> None:
        self.imports: set[str] = set()
        self.lines: list[str] = []

    def let(self, kind: str, value: str) -> str:
        name = f"{kind}{len(self.lines)}"
        self.lines.append(f"let {name} = {value};")
        return name

    def call(self, module: str, function: str, *arguments: str) -> str:
        self.imports.add(f"import {module}::{function};")
        return f"{function}({', '.join(arguments)})"

    def write(self, shape: Shape, p: str) -> str:
        match shape:
            case Primitive():
                return self.let("d", self.call(shape.module, shape.code, p, rows(shape.numbers)))
            case Modifier():
                at = p
                if shape.warps:
                    at = self.let("p", self.call(shape.module, f"{shape.code}_enter", p, rows(shape.numbers)))
                d = self.write(shape.shape, at)
                if shape.adjusts:
                    d = self.let("d", self.call(shape.module, f"{shape.code}_leave", d, p, rows(shape.numbers)))
                return d
            case Transformed():
                m = np.linalg.inv(shape.placement)[:3]
                dots = ", ".join(
                    f"dot(vec3f({', '.join(repr(float(x)) for x in row[:3])}), {p}) + ({float(row[3])!r})" for row in m
                )
                return self.let("d", f"{shape.factor!r} * {self.write(shape.shape, self.let('p', f'vec3f({dots})'))}")
            case Repetition():
                values = [self.write(copy, p) for copy in shape.copies()]
                d = values[0]
                for value in values[1:]:
                    d = self.let("d", f"min({d}, {value})")
                return d
            case _:
                raise TypeError(shape)


def of_formulas(shape: Shape) -> bool:
    return not any(issubclass(cls, (Combination, Painted, Named)) for cls in classes(shape))


FORMULAS = [name for name, shape in CASES.items() if of_formulas(shape)]
BATCH = 42  # Mesa's software adapter keeps 80 masks of nested branches, and makes a switch a nest of them


@pytest.mark.parametrize("first", range(0, len(FORMULAS), BATCH))
def test_the_device_has_the_same_values(gpu: Gpu, first: int) -> None:
    """Many formulas in one kernel, each at its own places, far ones too."""
    names = FORMULAS[first : first + BATCH]
    writer, cases = Writer(), []
    for i, name in enumerate(names):
        writer.lines = []
        result = writer.write(CASES[name], "p")
        cases.append(f"case {i}u: {{ {' '.join(writer.lines)} return {result}; }}")
    text = "\n".join(
        [
            *sorted(writer.imports),
            f"fn value(which: u32, p: vec3f) -> f32 {{ switch which {{ {' '.join(cases)}",
            "default: { return 0.0; } } }",
            "fn evaluate(x: vec4f) -> vec4f { return vec4f(value(u32(x.w), x.xyz)); }",
        ]
    )
    near, far = (np.stack([places(CASES[n], 60, 3, margin) for n in names]) for margin in (0.3, 8.0))
    at = np.concatenate([near, far], axis=1).astype(np.float32)
    which = np.broadcast_to(np.arange(len(names), dtype=np.float32)[:, None, None], (*at.shape[:2], 1))
    inputs = np.concatenate([at, which], axis=2).reshape(-1, 4)
    values = props.evaluate(gpu, f"test_vocabulary_{first}", text, inputs)[:, 0].reshape(at.shape[:2])
    for i, name in enumerate(names):
        away = np.abs(values[i] - CASES[name](at[i]))
        allowed = 1e-5 * CASES[name].lipschitz * (1 + np.linalg.norm(at[i], axis=1))
        assert (away <= allowed).all(), f"{name}: {(away / allowed).max():.1f} times what is allowed"


def test_an_ellipsoid_is_as_exact_as_its_places_on_the_device(gpu: Gpu) -> None:
    """Half axes of 1 : 1 to 1 : 100, next to the surface and far away; where the distance is known."""
    rng = np.random.default_rng(4)
    radii = np.exp(rng.uniform(math.log(0.011), 0, (12, 3)))
    radii = (radii / radii.max(axis=1, keepdims=True)).astype(np.float32).astype(np.float64)
    turn = rng.normal(size=(12, 300, 3))
    surface = turn / np.linalg.norm(turn, axis=2, keepdims=True) * radii[:, None]
    normal = surface / radii[:, None] ** 2
    away = 10 ** rng.uniform(-3, 1.5, (12, 300))
    at = surface + normal / np.linalg.norm(normal, axis=2, keepdims=True) * away[..., None]
    listed = ", ".join(f"vec3f({', '.join(repr(float(x)) for x in row)})" for row in radii)
    text = f"""import package::sdf::solids::ellipsoid_distance;
fn evaluate(x: vec4f) -> vec4f {{
    var radii = array<vec3f, 12>({listed});
    return vec4f(ellipsoid_distance(x.xyz, radii[u32(x.w)]));
}}"""
    which = np.broadcast_to(np.arange(12.0)[:, None, None], (12, 300, 1))
    inputs = np.concatenate([at, which], axis=2).reshape(-1, 4).astype(np.float32)
    values = props.evaluate(gpu, "test_vocabulary_ellipsoids", text, inputs)[:, 0].reshape(away.shape)
    assert (np.abs(values - away) <= 1e-6 * (1 + np.linalg.norm(at, axis=2))).all()
    for row, places_, distances in zip(radii, at, away, strict=True):
        assert np.allclose(sdf.ellipsoid(tuple(row.tolist()))(places_), distances, rtol=1e-9, atol=1e-12)


# --- what a node says of itself -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
def test_the_lipschitz_bound_holds(name: str) -> None:
    """For pairs near each other and far apart, near the shape and far from it."""
    shape, rng = CASES[name], np.random.default_rng(1)
    slopes = []
    for margin, count in ((0.4, 3000), (4.0, 1500)):
        p = places(shape, count, 5, margin)
        for apart in (1e-4, 3e-2, 1.0):
            step = rng.normal(0, apart, p.shape) * ([1, 1, 1] if shape.dimension == 3 else [1, 1, 0])
            slopes.append(np.abs(shape(p + step) - shape(p)) / np.linalg.norm(step, axis=1))
    steepest = float(np.max([s.max() for s in slopes]))
    assert steepest <= shape.lipschitz * (1 + 1e-6), f"{steepest} of {shape.lipschitz}"
    assert steepest >= shape.lipschitz * (0.3 if name in LOOSE else 0.85), f"only {steepest} of {shape.lipschitz}"


@pytest.mark.parametrize("name", EXACT)
def test_a_distance_leads_to_the_surface(name: str) -> None:
    """|f| down the gradient there is a surface; with the bound above no surface is nearer."""
    shape = CASES[name]
    assert shape.lipschitz == 1
    p = places(shape, 2000, 2)
    d = shape(p)
    if shape.accuracy == "outside":
        p, d = p[d > 0], d[d > 0]
    ends = shape(p - d[:, None] * gradient(shape, p))
    off = np.abs(ends) > 2e-5 * (1 + np.abs(d))
    assert off.mean() <= 0.002, f"{off.sum()} of {len(d)} ends are off, by {np.abs(ends).max():g} at most"


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("level", [0.0, 0.25])
def test_the_box_holds_what_is_inside(name: str, level: float) -> None:
    shape = CASES[name]
    low, high = shape.extent(level)
    assert (low <= high).all()
    p = places(shape, 4000, 4, level + 0.5)
    within = p[shape(p) <= level]
    assert (within >= low - 1e-9).all()
    assert (within <= high + 1e-9).all()


@pytest.mark.parametrize("name", [name for name, shape in CASES.items() if isinstance(shape, Primitive)])
def test_the_box_of_a_primitive_is_the_least(name: str) -> None:
    """On every side that has an end there is a place of the surface."""
    shape = CASES[name]
    low, high = shape.box
    span = np.linspace(0, 1, 61)
    for axis in range(shape.dimension):
        for side in (low, high):
            if not math.isfinite(side[axis]):
                continue
            grid = np.zeros((61 * 61, 3))
            others = [a for a in range(3) if a != axis]
            for other, s in zip(others, np.meshgrid(span, span), strict=True):
                ends = np.clip([low[other], high[other]], -2, 2)
                grid[:, other] = (ends[0] + (ends[1] - ends[0]) * s).ravel()
            grid[:, axis] = side[axis]
            least = shape(grid).min()
            assert -1e-9 <= least <= 0.03, f"axis {axis}: {least}"


def test_inside_is_negative() -> None:
    for name, shape in CASES.items():
        d = shape(places(shape, 6000, 6, 0.2))
        assert (d < 0).any(), name
        assert (d > 0).any(), name


def test_known_values() -> None:
    """Places whose distance anybody can tell."""
    root = math.sqrt
    known: list[tuple[Shape, tuple[float, ...], float]] = [
        (sdf.sphere(2), (3, 0, 0), 1),
        (sdf.box(2), (2, 2, 0), root(2)),
        (sdf.box(2), (0.5, 0, 0), -0.5),
        (sdf.cylinder(1, 2), (0, 0, 3), 2),
        (sdf.cylinder(1), (0, 3, 99), 2),
        (sdf.plane(Y, 1), (7, 3, 7), 2),
        (sdf.torus(2, 0.5), (0, 3, 0), 0.5),
        (sdf.cone(1, 1), (1, 0, 0.5), root(2) / 2),
        (sdf.octahedron(1), (0, 0, 0), -1 / root(3)),
        (sdf.tetrahedron(1), (0, 0, 0), -1 / 3),
        (sdf.tetrahedron(1), (-2, -2, -2), root(12) - 1 / 3),
        (sdf.dodecahedron(1), (0, 0, 0), -0.794654472291766),
        (sdf.icosahedron(1), (0, 0, 0), -0.794654472291766),
        (sdf.pyramid(2, 1), (0, 0, 3), 2),
        (sdf.pyramid(2, 1), (0, 0, -2), 2),
        (sdf.ellipsoid((3, 2, 1)), (5, 0, 0), 2),
        (sdf.ellipsoid((3, 2, 1)), (0, 0, 5), 4),
        (sdf.hexagonal_prism(1, 2), (0, 2, 0), 2 - root(0.75)),
        (sdf.triangular_prism(1, 2), (0, -2, 0), 1.5),
        (sdf.octagonal_prism(1, 2), (2, 0, 0), 2 - math.cos(math.pi / 8)),
        (sdf.pentagon(1), (0, 3), 2),
        (sdf.pentagon(1), (0, 0), -math.cos(math.pi / 5)),
        (sdf.star(4, 1, 0.2), (0, -3), 2),
        (sdf.heart(1), (0, -2), 2),
        (sdf.egg(0.6, 0.2), (0, -1), 0.4),
        (sdf.circle(1).revolve(3), (0, 0, 5), 1),
        (sdf.circle(1).extrude(4), (0, 0, 5), 3),
        (sdf.sphere(1).round(0.5), (3, 0, 0), 1.5),
        (sdf.sphere(1).shell(0.2), (0, 0, 0), 0.9),
        (sdf.sphere(1).elongate(4), (5, 0, 0), 2),
        (sdf.sphere(0.5).repeat(4, 3), (6, 0, 0), 1.5),
        (sdf.sphere(0.5).repeat(4), (402, 0, 0), 1.5),
        (sdf.sphere(0.5).at(2).polar(4), (0, -4, 0), 1.5),
        (sdf.sphere(0.5).at(2).mirror(), (-4, 0, 0), 1.5),
        (sdf.sphere(1).scale(2).at(1), (5, 0, 0), 2),
    ]
    for shape, place, distance in known:
        assert shape([place])[0] == pytest.approx(distance, abs=1e-9), (shape, place)


def test_an_ellipsoid_is_what_the_sphere_around_a_long_search_finds() -> None:
    """Against distances to 200,000 places of the surface."""
    turn = np.random.default_rng(0).normal(size=(200_000, 3))
    for radii in ((1, 0.7, 0.5), (0.2, 1.5, 0.4)):
        surface = turn / np.linalg.norm(turn, axis=1)[:, None] * radii
        p = np.random.default_rng(1).uniform(-2, 2, (12, 3))
        least = np.array([np.linalg.norm(surface - place, axis=1).min() for place in p])
        got = sdf.ellipsoid(radii)(p)
        outside = got > 0
        np.testing.assert_allclose(got[outside], least[outside], atol=0.01)
        assert (np.abs(got[~outside]) <= least[~outside] + 1e-9).all()


# --- repetitions, moves, mistakes ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "shape",
    [
        sdf.sphere(0.3).at(0.1, 0.05),
        sdf.box(0.8).rotate(0.5),
        sdf.box((0.3, 0.2, 0.5)).twist(3),
        sdf.ellipsoid((0.5, 0.2, 0.3)).at(0.2),
    ],
)
def test_endless_copies_are_the_union_of_all(shape: Shape) -> None:
    endless = shape.repeat(0.9)
    assert isinstance(endless, RepeatedForever)
    p = np.random.default_rng(0).uniform(-1.4, 1.4, (1500, 3))
    steps = np.array(list(np.ndindex(7, 7, 7))) - 3
    several = np.min([shape(p - 0.9 * s) for s in steps], axis=0)
    np.testing.assert_allclose(endless(p), np.minimum(several, endless.cap), atol=1e-12)
    assert endless.cap >= 0.19


def test_a_limited_repetition_is_its_copies() -> None:
    shape = sdf.cone(0.2, 0.4)
    row = shape.repeat(0.5, (3, 1, 2))
    by_hand = sdf.union(*(shape.at(x, 0, z) for x in (-0.5, 0, 0.5) for z in (-0.25, 0.25)))
    p = places(row, 500)
    np.testing.assert_allclose(row(p), by_hand(p))
    for a, b in zip(row.box, by_hand.box, strict=True):
        np.testing.assert_allclose(a, b)
    ring = shape.at(1).polar(4)
    by_hand = sdf.union(*(shape.at(1).rotate(i * math.pi / 2) for i in range(4)))
    np.testing.assert_allclose(ring(p), by_hand(p))


def test_what_touches_a_mirror_is_no_distance_inside() -> None:
    """The surface that it had there is gone; where it is apart from the mirror nothing changes, across it all does."""
    flat, solid = sdf.rectangle(1), sdf.box(1)
    for place, accuracy in ((0.7, "exact"), (0.5, "outside"), (0.3, "bound")):
        assert flat.at(place).revolve().accuracy == accuracy
        assert flat.revolve(place).accuracy == accuracy
        assert solid.at(place).mirror().accuracy == accuracy
        assert solid.repeat(2 * place, mirrored=True).accuracy == accuracy
    p = np.array([[0.1, 0.0, 0.2]])
    assert flat.at(0.5).revolve()(p)[0] > -0.25  # a cylinder's is -0.5


def test_quarter_turns_keep_what_has_no_end_on_its_axis() -> None:
    low, high = sdf.cylinder(0.5).orient(X).box
    np.testing.assert_allclose([low, high], [(-np.inf, -0.5, -0.5), (np.inf, 0.5, 0.5)])


def test_a_mirrored_repetition_is_mirror_images() -> None:
    shape = sdf.cone(0.2, 0.4).at(0.1, 0.1, 0.1)
    p = np.random.default_rng(0).uniform(-0.5, 0.5, (300, 3))
    field = shape.repeat(1.0, mirrored=True)
    np.testing.assert_allclose(field(p), shape(p))
    np.testing.assert_allclose(field([1, 0, 0] + p * [-1, 1, 1]), shape(p))
    np.testing.assert_allclose(field([2, 1, 0] + p * [1, -1, 1]), shape(p))


@pytest.mark.parametrize("name", ["octahedron()", "twisted", "union, root", "repeated", "noisy"])
def test_a_shape_moves_with_its_place(name: str) -> None:
    shape = CASES[name]
    p = places(shape, 300)
    matrix = np.eye(4)
    matrix[:3] = np.array(sdf.sphere().rotate(0.8, (1, -2, 0.5)).scale(1.5).at(0.3, 0.1, -2).placement)[:3]
    moved = p @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(shape.transform(matrix)(moved), 1.5 * shape(p), atol=1e-12)


def test_an_axis_is_turned_where_it_should_be() -> None:
    for axis in (X, Y, Z, (0, 0, -1), (1, -2, 0.5)):
        tall = sdf.capsule((0, 0, 0), (0, 0, 1), 0.1).orient(axis)
        tip = np.array(axis) / np.linalg.norm(axis)
        assert tall([tip * 1.5])[0] == pytest.approx(0.4)


def test_a_twist_is_right_handed_and_its_bound_is_the_known_one() -> None:
    arm = sdf.box((2, 0.2, 4)).twist(math.pi / 2)
    assert arm([[0.9, 0, 0]])[0] < 0 < arm([[0, 0.9, 0]])[0]
    assert arm([[0, 0.9, 1]])[0] < 0 < arm([[0.9, 0, 1]])[0]
    assert arm([[0.6, 0.6, 0.5]])[0] < 0 < arm([[0.6, -0.6, 0.5]])[0]
    kr = math.pi / 2 * math.hypot(1, 0.1)
    assert arm.lipschitz == pytest.approx((kr + math.sqrt(kr * kr + 4)) / 2)


def test_noise_is_of_its_seed() -> None:
    p = np.random.default_rng(0).uniform(-5, 5, (20_000, 3))
    a, b = (sdf.sphere(1).noise(1, 1, seed)(p) - sdf.sphere(1)(p) for seed in (0, 1))
    for n in (a, b):
        assert np.abs(n).max() <= 1
        assert abs(n.mean()) < 0.05
        assert n.std() > 0.2
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.05


MISTAKES = {
    "sphere(-1)": "radius: -1 is outside ≥ 1e-06",
    "sphere() | circle()": "shapes: some are flat and some solid; extrude or revolve the flat ones first",
    "circle().twist(1)": "twist: Circle is flat; this is for solid shapes",
    "circle().displace(1, 1)": "displace: Circle is flat; this is for solid shapes",
    "sphere().extrude(1)": "extrude: Sphere is solid; this is for flat shapes",
    "sphere().revolve()": "revolve: Sphere is solid; this is for flat shapes",
    "circle().rotate(1, X)": "matrix: it turns a flat shape out of its plane; extrude or revolve it first",
    "plane().twist(1)": "twist: Plane has no end across Z; cut it first",
    "sphere(2).repeat(1)": "spacing: (1, 1, 1) is less than the shape reaches from 0: (-2, -2, -2) to (2, 2, 2)",
    "sphere().repeat(0)": "spacing: 0 on all axes",
    "sphere().repeat(1, (99, 99, 1))": "counts: 9801 copies are more than 4096",
    "sphere().repeat(1, 2, mirrored=True)": "mirrored: only without end; leave out the count",
    "sphere().repeat((1, 2))": "spacing: (1, 2) is not one number or three",
    "circle().repeat((1, 1, 1))": "spacing: a flat shape has no copies along Z",
    "sphere().polar(0)": "number: 0 is outside 1 … 4096",
    "circle().polar(3, X)": "axis: a flat shape turns about Z only",
    "sphere().mirror('w')": "axes: 'w' is not some of x, y and z",
    "sphere().orient((0, 0, 0))": "axis: (0, 0, 0) is no direction",
    "sphere().scale(0)": "factor: 0 is no finite enlargement above 0",
    "sphere().at((1, 2, 3))": "at: ((1, 2, 3), 0.0, 0.0) are not three numbers; a tuple is given as .at(*place)",
    "sphere().at(float('nan'))": "at: (nan, 0.0, 0.0) are not finite numbers",
    "sphere().rotate(90, 'x')": "axis: 'x' is no direction",
    "sphere().rotate(float('inf'))": "angle: inf is no finite number",
    "sphere().repeat(1, 2.5)": "counts: (2.5, 2.5, 2.5) is not 3 whole numbers",
    "sphere().repeat(3, 'x')": "count: 'x' is not one number or three",
    "sphere().named('')": "name: '' is no name",
    "sphere()('x')": "points: not an array of numbers of shape (count, 3)",
    "from_mesh('x.obj')": "mesh: 'x.obj' is no Mesh; tyndall.load(file).instances have some",
    "union([sphere()])": "shapes[0]: a list; its shapes are given as union(*shapes)",
    "polygon([(0, 0), (1, 1), (2, 0)])": ("polygon: its corners are given one by one, polygon((x, y), (x, y), (x, y))"),
    "round_cone(radius_a=3)": "round_cone: one ball holds the other; use a sphere",
    "ellipsoid((1, 1, 0.001))": "radii: one is less than a hundredth of another; scale a sphere",
    "rounded_box(1, 0.6)": "radius: 0.6 is more than half the shortest side",
    "death_star(1, 1, 3)": "death_star: the two balls' surfaces do not meet",
    "polygon((0, 0), (1, 1))": "polygon: 2 corners; unite polygons of 3 or 4",
    "polygon((0, 0), (1, 1), (2, 2))": "triangle: its corners lie in a line",
    "union()": "shapes: none are given",
    "union(1)": "shapes[0]: 1 is no shape",
    "plane((0, 0, 0))": "normal: (0, 0, 0) is no direction",
    "tube((0, 0, 0), (1, 1, 1), (0, 0, 0))": "tube: its ends are one place",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_a_mistake_is_told_in_one_line(text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        eval(text, vars(sdf).copy())
    assert str(caught.value) == MISTAKES[text]


def test_a_flat_shape_is_no_object() -> None:
    with pytest.raises(ParameterError, match="Circle is no solid shape"):
        Implicit(sdf.circle())
    with pytest.raises(ParameterError, match="^material: 'red' is no Material$"):
        Implicit(sdf.sphere(), material="red")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="^medium: 3 is no Medium$"):
        Volume(sdf.sphere(), 3)  # type: ignore[arg-type]


# --- what is no shape -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sdf.sphere(1).at("x"), "at: .* are not three numbers"),
        (lambda: sdf.sphere(1).scale((1, 2, 3, 4)), "factor: .* is not one number or three"),
        (
            lambda: sdf.sphere(1).transform([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]]),
            "matrix: its last row",
        ),
        (lambda: sdf.sphere(1).polar(3, (1, 2)), "axis: .* is no direction"),
        (lambda: sdf.sphere(1).named(5), "name: 5 is no name"),
        (lambda: sdf.sphere(1).material("red"), "material: 'red' is no Material"),
        (lambda: Combination((sdf.sphere(1),), "xor"), "operation: 'xor' is not one of 'union'"),
        (lambda: sdf.sphere(1).repeat(1.0), "spacing: .* leaves no room"),
    ],
)
def test_what_is_refused(make: Callable[[], Shape], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        make()


def test_numbers_may_be_of_numpy() -> None:
    assert sdf.sphere(0.1).repeat(np.float32(0.5), np.int64(2)).count == 2


def test_many_cuts_one_after_the_other_are_one_node() -> None:
    shape = sdf.box(1)
    for i in range(1000):
        shape = shape - sdf.sphere(0.1).at(0.01 * i)
    assert shape.depth == 3
    assert shape([[0.05, 0, 0]])[0] == pytest.approx(0.1)
    while shape.depth < MOST_DEEP:
        shape = sdf.union(shape, sdf.sphere(0.1), smooth=0.1)
    with pytest.raises(ParameterError, match="nodes within nodes"):
        sdf.union(shape, sdf.sphere(0.1), smooth=0.1)
    assert shape.lipschitz == 1
    assert np.isfinite(shape.box).all()
    assert np.isfinite(shape([[0, 0, 0]])).all()
    assert compile_shape(shape, Kinds()).size > 1000
