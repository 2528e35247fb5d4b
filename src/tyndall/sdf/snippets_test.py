"""A user's WGSL is a shape like any other; whatever it does, the device survives and the message names its place."""

from __future__ import annotations

import inspect
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, param
from tyndall.scene.model import Implicit
from tyndall.sdf import snippets
from tyndall.sdf.field import Field
from tyndall.sdf.sandbox import ROUNDS, SnippetError
from tyndall.sdf.shape import Floats, Shape, Vec3, union
from tyndall.sdf.snippets import Snippet, SnippetSource, evaluate, snippet, validate
from tyndall.sdf.solids import box, sphere

POINTS = np.random.default_rng(5).uniform(-2, 2, (200, 3))


@pytest.fixture(autouse=True)
def _on_the_tests_device(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(snippets, "_device", lambda: gpu)
    yield
    gpu.forget_groups()


@snippet(box=lambda size, centre: (np.array(centre) - size, np.array(centre) + size), exact=True)
def ball(size: float = param(1.0, 0.01, 10, "radius", unit="m"), centre: Vec3 = (0.0, 0.5, 0.0)) -> None:
    """A ball.

    fn ball(p: vec3f, size: f32, centre: vec3f) -> f32 {
        return length(p - centre) - size;
    }
    """


def of(text: str, *values: float) -> Snippet:
    return Snippet(SnippetSource("x", text), values)


def test_it_is_a_shape(gpu: Gpu) -> None:
    shape = ball(0.75, centre=(0.1, 0.2, 0.3))
    expected = np.linalg.norm(POINTS - (0.1, 0.2, 0.3), axis=1) - 0.75
    np.testing.assert_allclose(shape(POINTS), expected, atol=1e-6)
    cut = shape.at(0, 1, 0) - box(0.5)
    np.testing.assert_allclose(cut(POINTS), np.maximum(shape(POINTS - (0, 1, 0)), -box(0.5)(POINTS)), atol=1e-6)
    assert shape == ball(0.75, (0.1, 0.2, 0.3)) != ball(0.5)
    assert hash(shape) == hash(ball(0.75, (0.1, 0.2, 0.3)))
    assert ball.__doc__ == "A ball."
    assert str(inspect.signature(ball)).startswith("(size: float = 1.0, centre:")


def test_what_is_declared_is_what_it_says() -> None:
    shape = ball(0.5)
    assert shape.accuracy == "exact"
    np.testing.assert_allclose(shape.box, [(-0.5, 0, -0.5), (0.5, 1, 0.5)])
    np.testing.assert_allclose(shape.extent(0.25), [(-0.75, -0.25, -0.75), (0.75, 1.25, 0.75)])

    @snippet(lipschitz=lambda k: 2 * k, growth=0.5, box=((-1, -1, -1), (1, 1, 1)), distance=lambda p, k: k * p[:, 0])
    def slab(k: float) -> str:
        return "fn slab(p: vec3f, k: f32) -> f32 { return k * p.x; }"

    shape = slab(3.0)
    assert shape.lipschitz == 6
    assert shape.accuracy == "bound"
    np.testing.assert_allclose(shape.extent(1.0), [(-3, -3, -3), (3, 3, 3)])
    assert shape([[2.0, 0, 0]]) == 6  # of its oracle, in double precision
    assert not np.isfinite(of("fn f(p: vec3f) -> f32 { return p.x; }").box).any()


def test_in_the_plane() -> None:
    disc = of("fn disc(p: vec2f, r: f32) -> f32 { return length(p) - r; }", 0.5)
    assert disc.dimension == 2
    np.testing.assert_allclose(disc(POINTS[:, :2]), np.hypot(*POINTS[:, :2].T) - 0.5, atol=1e-6)


def test_numbers_as_the_documents_primitive() -> None:
    text = "fn f(p: vec3f, primitive: Primitive3D) -> f32 { return primitive.data[7] + primitive.data[0] * p.x; }"
    np.testing.assert_allclose(of(text, 2, 0, 0, 0, 0, 0, 0, 5)([[1, 0, 0]]), 7)
    assert of(text, 2).values == (2, 0, 0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ball(20.0), "size: 20 is outside 0.01 … 10"),
        (lambda: ball(radius=1.0), "unexpected keyword argument 'radius'"),
        (lambda: of("fn f(p: vec3f, r: f32) -> f32 { return r; }"), "x: 0 numbers are given, and it takes 1"),
        (lambda: of("fn f(p: vec3f, r: f32) -> f32 { return r; }", float("nan")), "not finite"),
        (lambda: of("fn f(p: f32) -> f32 { return p; }"), "1:1: 'f' is the shape"),
        (lambda: of("fn f(p: vec3f) -> vec3f { return p; }"), "1:1: 'f' is the shape"),
        (lambda: of("fn f(p: vec3f, n: u32) -> f32 { return 1.0; }"), "'n' is u32"),
        (lambda: of("fn f(p: vec3f, a: vec4f, b: vec4f, c: f32) -> f32 { return 1.0; }"), "more than 8"),
    ],
)
def test_mistakes(make: object, message: str) -> None:
    with pytest.raises((ParameterError, SnippetError), match=message):
        make()  # type: ignore[operator]


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"lipschitz": -1.0}, "^ring: lipschitz: -1 is outside"),
        ({"lipschitz": lambda wide: 1.0}, "^ring: lipschitz: not a function of radius: .*'radius'"),
        ({"box": (1, 2)}, r"^ring: box: \(1, 2\) is not two corners"),
        ({"box": ((0, 0, "a"), (1, 1, 1))}, "is no corner of a box"),
        ({"growth": 0.0}, "^growth: 0 is outside"),
    ],
)
def test_what_is_declared_wrongly_is_told_by_its_name(declared: dict[str, Any], message: str) -> None:
    def ring(radius: float = 0.5) -> str:
        return "fn ring(p: vec3f, radius: f32) -> f32 { return radius - length(p); }"

    with pytest.raises(ParameterError, match=message):
        snippet(**declared)(ring)()


def test_a_mistake_stands_in_the_python_file() -> None:
    with pytest.raises(SnippetError) as error:

        @snippet()
        def wrong(r: float = 1.0) -> None:
            """Nothing.

            fn wrong(p: vec3f, r: f32) -> f32 {
                return length(p) - radius;
            }
            """

    lines = Path(__file__).read_text().splitlines()
    line = next(i for i, text in enumerate(lines, 1) if "return length(p) - radius;" in text)
    column = lines[line - 1].index("radius") + 1
    assert str(error.value) == f"{__file__}:{line}:{column}: no such name: 'radius' — did you mean 'radians'?"


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        ("fn f(p: vec3f) -> f32 {\n  return p + 1.0;\n}", "2:", "return"),
        ("fn f(p: vec3f) -> f32 {\n  let u = 2u;\n  return length(p) * u;\n}", "3:10", "Multiply"),
        ("fn f(p: vec3f) -> f32 {\n  return length(p,\n 2.0);\n}", "2:10", "too many arguments"),
        ("fn f(p: vec3f) -> f32 {\n  let banana: i32 = p.x;\n  return 1.0;\n}", "2:7", "`banana`"),
        ("fn g(x: u32) -> f32 { return 1.0; }\nfn f(p: vec3f) -> f32 {\n  return g(p.x);\n}", "3:10", "Argument 0"),
        ("fn f(p: vec3f) -> f32 {\n  if p.x > 1.0 { return 1.0; }\n}", "1:1", "return"),
    ],
)
def test_types_are_the_drivers_and_places_the_users(gpu: Gpu, text: str, where: str, message: str) -> None:
    with pytest.raises(SnippetError) as error:
        validate(gpu, SnippetSource("x", text))
    told = str(error.value)
    assert told.startswith(f"<snippet>:{where}")
    assert message in told
    assert "\n" not in told


@pytest.mark.parametrize(
    "body",
    [
        "loop { x += 1.0; }",
        "while true { x += 1.0; }",
        "for (;;) { for (;;) { x += 1.0; } }",
        "loop { x += 1.0; continuing { x -= 1.0; break if x > 9.0; } }",
        "for (var i = 0; i < 100000000; i++) { x += endless(); }",
    ],
)
def test_an_endless_loop_ends(gpu: Gpu, body: str) -> None:
    text = (
        f"fn endless() -> f32 {{ loop {{ }} return 1.0; }}\nfn f(p: vec3f) -> f32 {{ var x = p.x; {body} return x; }}"
    )
    started = time.monotonic()
    evaluate(gpu, of(text), np.repeat(POINTS, 50, axis=0))
    assert time.monotonic() - started < 20


def test_a_loop_may_turn_as_often_as_is_said() -> None:
    text = "fn f(p: vec3f, n: f32) -> f32 { var x = 0.0; for (var i = 0; i < i32(n); i++) { x += 1.0; } return x; }"
    assert of(text, ROUNDS)([[0, 0, 0]]) == ROUNDS
    assert of(text, ROUNDS + 1)([[0, 0, 0]]) == 0


def test_no_value_is_beyond_what_a_march_can_take() -> None:
    assert abs(of("fn f(p: vec3f) -> f32 { return p.x * 1e30 * 1e30; }")([[1, 0, 0]])[0]) <= 1.001e30


def test_it_is_compiled_with_every_check(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    from tyndall.gpu import device

    asked: list[bool] = []
    create = device.create_module
    monkeypatch.setattr(device, "create_module", lambda *a, trusted, **k: asked.append(trusted) or create(*a, **k))
    of("fn f(p: vec3f) -> f32 { return p.x + 0.125; }")([[0, 0, 0]])
    assert asked == [False]
    with Field(gpu, [Implicit(ball() | sphere(0.5))]) as field:
        assert not field.is_trusted
        assert field.bindings["implicit_objects"].slot.untrusted
    gpu.discard()
    with Field(gpu, [Implicit(sphere(0.5))]) as field:
        assert not field.bindings["implicit_objects"].slot.untrusted


def test_a_field_tells_what_does_not_compile(gpu: Gpu) -> None:
    bad = of("fn f(p: vec3f) -> f32 {\n  return 2u;\n}")
    with pytest.raises(SnippetError, match="<snippet>:2:"):
        Field(gpu, [Implicit(bad)])


_RAYS = """
import package::bindings::out;
import package::sdf::march::{march_closest, field_normal};
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let direction = normalize(vec3f((vec2f(id.xy) - 15.5) / 32.0, -1.0));
    let hit = march_closest(vec3f(0.0, 0.5, 3.0), direction, 0.0, 100.0, 0.0);
    out[32u * id.y + id.x] = vec4f(hit.t, field_normal(0u, vec3f(0.0, 0.5, 3.0) + hit.t * direction, 0.001));
}
"""


def march(gpu: Gpu, shape: Shape) -> Floats:
    """(32, 32, 4) of a small picture: distance of the hit, and the normal there."""
    with (
        props.module(gpu, "test_snippet_rays", _RAYS) as path,
        Field(gpu, [Implicit(shape)]) as field,
        gpu.buffer("test.out", 16 * 1024, owner="test", element="vec4f") as out,
    ):
        field.update()
        gpu.compute("test", path, "main").bind(field.bindings, out=out.read_write()).dispatch(32, 32)
        got = gpu.read_buffer(out).view(np.float32).reshape(32, 32, 4).astype(np.float64)
        gpu.forget_groups()
    return got


def test_it_is_drawn_like_a_solid(gpu: Gpu) -> None:
    got = march(gpu, ball(0.8))
    x, y = np.meshgrid(*2 * [(np.arange(32) - 15.5) / 32])
    d = np.stack([x, y, -np.ones_like(x)], axis=2)
    d /= np.linalg.norm(d, axis=2, keepdims=True)
    along = -3 * d[..., 2]  # to the foot of the centre's perpendicular
    square = 0.8**2 - (9 - along**2)
    inside = square > 0.01
    assert 100 < inside.sum() < 1000
    t = along - np.sqrt(np.maximum(square, 0))
    np.testing.assert_allclose(got[..., 0][inside], t[inside], atol=2e-3)
    assert (got[..., 0][square < -0.01] > 100).all()
    normals = ((0, 0.5, 3) + t[..., None] * d - (0, 0.5, 0)) / 0.8
    np.testing.assert_allclose(got[..., 1:][inside], normals[inside], atol=5e-3)


def test_a_picture_with_an_endless_loop_comes(gpu: Gpu) -> None:
    """Also where it is one part of many, which are pruned by its values."""
    endless = of("fn f(p: vec3f) -> f32 { var x = p.x; loop { x += 1.0; } return x; }")
    started = time.monotonic()
    march(gpu, endless)
    bounded = Snippet(endless.source, (), 1.0, (-1, -1, -1), (1, 1, 1))
    march(gpu, union(bounded, *(sphere(0.1).at(0.1 * i) for i in range(20)), smooth=0.1))
    assert time.monotonic() - started < 60


def test_the_same_name_twice(gpu: Gpu) -> None:
    a, b = (of(f"fn f(p: vec3f) -> f32 {{ return p.x + {x}; }}") for x in ("1.0", "2.0"))
    values: Floats = (a | b)(POINTS)
    np.testing.assert_allclose(values, POINTS[:, 0] + 1, atol=1e-6)
    with Field(gpu, [Implicit(a | b | sphere(1))]) as field:
        field.update()
        gpu.wait()
