"""What every shape says of itself, held against its values, for expressions that nobody wrote.

Random trees over all primitives, modifiers, repetitions, transforms and combinations; a failure is made small and shown
as an expression.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import props
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, fields_of
from tyndall.scene.model import Implicit
from tyndall.sdf import PROFILES, SOLIDS, Grid, Shape, from_mesh, intersection, sphere, subtraction, union
from tyndall.sdf.field import Field
from tyndall.sdf.program import Kinds, compile_shape
from tyndall.sdf.shape import Primitive

_SETTINGS = settings(
    max_examples=100,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much],
)
GRID: list[Grid] = []


def grid() -> Grid:
    if not GRID:
        GRID.append(from_mesh((sphere(0.7) - sphere(0.5).at(0.5)).to_mesh(16), 12))
    return GRID[0]


_length = st.floats(0.05, 1.5)
_place = st.floats(-1.5, 1.5)
_axis = st.tuples(_place, _place, _place).filter(lambda a: np.linalg.norm(a) > 0.1)


@st.composite
def primitives(draw: Any, kinds: dict[str, type[Primitive]]) -> Shape:
    """One of a catalogue, its numbers other than its defaults where it allows."""
    cls = kinds[draw(st.sampled_from(sorted(kinds)))]
    changes = {}
    for f in fields_of(cls):
        if isinstance(f.default, float):
            changes[f.name] = f.default * draw(st.floats(0.5, 1.5))
        elif isinstance(f.default, tuple) and all(isinstance(x, float) for x in f.default):
            changes[f.name] = tuple(x * draw(st.floats(0.5, 1.5)) for x in f.default)
    try:
        return cls(**changes)
    except ParameterError:
        return cls()


def flat() -> st.SearchStrategy[Shape]:
    inner = primitives(PROFILES)
    return st.recursive(inner, lambda inner: st.one_of(joined(inner), placed(inner, flat=True)), max_leaves=3)


@st.composite
def joined(draw: Any, inner: st.SearchStrategy[Shape]) -> Shape:
    shapes = draw(st.lists(inner, min_size=2, max_size=4))
    smooth = draw(st.one_of(st.just(0.0), st.floats(0.01, 0.5)))
    blend = draw(st.sampled_from(["polynomial", "exponential", "root"]))
    return draw(st.sampled_from([union, intersection, subtraction]))(*shapes, smooth=smooth, blend=blend)


@st.composite
def placed(draw: Any, inner: st.SearchStrategy[Shape], flat: bool = False) -> Shape:
    shape = draw(inner)
    match draw(st.sampled_from(["at", "rotate", "scale", "stretch"])):
        case "at":
            return shape.at(draw(_place), draw(_place), 0.0 if flat else draw(_place))
        case "rotate":
            return shape.rotate(draw(st.floats(-4, 4)), (0, 0, 1) if flat else draw(_axis))
        case "scale":
            return shape.scale(draw(st.floats(0.3, 2)))
        case _:
            factors = [draw(st.floats(0.4, 2)) for _ in range(3)]
            return shape.scale(factors)


@st.composite
def changed(draw: Any, inner: st.SearchStrategy[Shape]) -> Shape:
    """One modifier or repetition; what a shape does not allow is left out."""
    shape = draw(inner)
    kind = draw(st.sampled_from(["round", "shell", "elongate", "displace", "noise", "twist", "bend", "mirror", "many"]))
    try:
        match kind:
            case "round" | "shell":
                return getattr(shape, kind)(draw(_length))
            case "elongate":
                return shape.elongate(draw(_length), draw(_length), draw(_length))
            case "displace" | "noise":
                return getattr(shape, kind)(draw(st.floats(0.01, 0.2)), draw(st.floats(0.3, 1)))
            case "twist" | "bend":
                return getattr(shape, kind)(draw(st.floats(-2, 2)))
            case "mirror":
                return shape.mirror(draw(st.sampled_from(["x", "y", "z", "xy", "xyz"])))
            case _:
                spacing = draw(st.floats(0.5, 4))
                return draw(
                    st.sampled_from(
                        [
                            lambda: shape.repeat(spacing, (3, 1, 2)),
                            lambda: shape.repeat(spacing),
                            lambda: shape.repeat((spacing, 0, spacing)),
                            lambda: shape.repeat(spacing, mirrored=True),
                            lambda: shape.polar(5),
                            lambda: shape.polar(3, (1, 2, 0)),
                        ]
                    )
                )()
    except ParameterError:
        return shape


@st.composite
def raised(draw: Any) -> Shape:
    shape = draw(flat())
    try:
        return shape.extrude(draw(_length)) if draw(st.booleans()) else shape.revolve(draw(st.floats(0, 1)))
    except ParameterError:
        return shape.extrude(1.0)


def solid() -> st.SearchStrategy[Shape]:
    leaves = st.one_of(primitives(SOLIDS), raised(), st.builds(grid))
    return st.recursive(leaves, lambda inner: st.one_of(joined(inner), placed(inner), changed(inner)), max_leaves=5)


def check_shape(shape: Shape, seed: int) -> None:
    rng = np.random.default_rng(seed)
    flat = np.array([1.0, 1.0, 0.0]) if shape.dimension == 2 else np.ones(3)
    p = rng.normal(size=(1500, 3)) * rng.choice([0.3, 1.5, 6.0], (1500, 1)) * flat
    value = shape(p)
    assert np.isfinite(value).all()
    # Values far beyond float64's neighbourhood of 1 carry its rounding with them.
    rounding = 1e-12 * (1 + np.abs(p).max()) * max(1.0, shape.lipschitz)

    for spread in (1e-4, 0.03, 1.0):
        offset = rng.normal(size=p.shape) * spread * flat
        change = np.abs(shape(p + offset) - value)
        apart = np.linalg.norm(offset, axis=1)
        worst = int((change - shape.lipschitz * apart).argmax())
        assert change[worst] <= shape.lipschitz * apart[worst] * (1 + 1e-9) + 1e3 * rounding, (
            f"L {shape.lipschitz:.4g}, but {change[worst] / apart[worst]:.6g} at {p[worst]} over {offset[worst]}"
        )

    for level in (0.0, 0.1, 1.0):
        low, high = shape.extent(level)
        held = p[value <= level]
        beyond = np.maximum(low - held, held - high).max(initial=-np.inf)
        assert beyond <= 1e-9 * (1 + np.abs(p).max()), f"level {level}: {beyond:.4g} m beyond its extent"

    if shape.accuracy != "bound":
        # A distance changes as fast as the place where it is told to be one: along its own gradient, by 1.
        where = value > 1e-3 if shape.accuracy == "outside" else np.abs(value) > 1e-3
        h = 1e-6
        steps = [np.eye(3)[axis] * h for axis in range(3 - (shape.dimension == 2))]
        slope = np.stack([(shape(p + step) - shape(p - step)) / (2 * h) for step in steps], axis=1)
        size = np.linalg.norm(slope, axis=1)[where]
        assert (np.abs(size - 1) < 1e-4).mean() > 0.97 if len(size) > 50 else True, (
            f"{shape.accuracy}, but the gradient is {np.quantile(size, [0.02, 0.5, 0.98])}"
        )


@_SETTINGS
@given(solid(), st.integers(0, 1000))
def test_solids(shape: Shape, seed: int) -> None:
    assume(shape.count < 60)
    check_shape(shape, seed)


@_SETTINGS
@given(flat(), st.integers(0, 1000))
def test_profiles(shape: Shape, seed: int) -> None:
    assume(shape.count < 60)
    check_shape(shape, seed)


@pytest.mark.parametrize("kind", [*sorted(SOLIDS), *sorted(PROFILES)])
def test_every_primitive_by_itself(kind: str) -> None:
    """With its defaults, so that none is left out."""
    check_shape({**SOLIDS, **PROFILES}[kind](), 3)


_names = (f"test_fuzz_{i}" for i in itertools.count())
VALUES = """
    import package::bindings::implicit_objects;
    import package::sdf::interpreter::evaluate as whole;
    import package::sdf::objects::bound_at;
    fn evaluate(x: vec4f) -> vec4f {
        let object = implicit_objects[u32(x.w)];
        let bound = bound_at(object, x.xyz);
        return vec4f(whole(object.begin, object.count, x.xyz), bound.value, bound.lipschitz, 0.0);
    }
"""


def _has_program(shape: Shape) -> bool:
    try:
        compile_shape(shape, Kinds())
    except ParameterError:
        return False
    return shape.count < 60 and shape.lipschitz < 100


@settings(_SETTINGS, max_examples=1, phases=(Phase.generate,))
@given(shapes=st.lists(solid().filter(_has_program), min_size=12, max_size=12))
def test_the_device_has_the_same_values_whole_and_in_cells(gpu: Gpu, shapes: list[Shape]) -> None:
    """Whole programs have the values of numpy. In its cells a value is the same, or of the same sign and less."""
    rng = np.random.default_rng(6)
    rows = []
    for index, shape in enumerate(shapes):
        low, high = (np.clip(corner, -3, 3) for corner in shape.box)
        places = rng.uniform(low, np.maximum(high, low), (400, 3))
        rows.append(np.concatenate([places, np.full((400, 1), index)], axis=1))
    inputs = np.concatenate(rows).astype(np.float32)
    with Field(gpu, [Implicit(shape) for shape in shapes]) as field:
        field.update()
        found = props.evaluate(gpu, next(_names), VALUES, inputs, field.bindings).reshape(len(shapes), 400, 4)
    for shape, given_rows, values in zip(shapes, inputs.reshape(len(shapes), 400, 4), found, strict=True):
        expected = shape(given_rows[:, :3])
        whole, part, slope = values[:, :3].T
        tolerance = 2e-5 * max(1.0, shape.lipschitz) * (1 + np.abs(given_rows[:, :3]).max()) + 1e-4 * np.abs(expected)
        assert (np.abs(whole - expected) <= tolerance).all(), (shape, np.abs(whole - expected).max())
        assert (np.abs(part) <= np.abs(expected) + tolerance).all(), (shape, "more than the value")
        apart = np.abs(expected) > tolerance
        assert (np.sign(part) * np.sign(expected) >= 0)[apart].all(), (shape, "of another sign")
        assert (slope <= shape.lipschitz * 1.001).all(), shape
