"""A rectangular light at a point: against the catalogue's form factors, and against sums over its points in float64."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import props
import pytest

from tyndall.frame import pack_lights, pack_medium
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Medium, RectLight, Scene

LIGHT = "package::wesl::light::Light"
MEDIUM = "package::wesl::medium::Medium"
IMPORTS = """
    import package::bindings::{lights, medium, normals};
    import package::wesl::horizon::{towards_rect};
    import package::wesl::light::{incident, incident_in_air, rect_seen_from, seen_from};
"""
PANEL = RectLight((0.3, 2.0, -0.4), (0.2, -1.0, 0.1), 8.0, (1.0, 0.5, 0.25), width=1.4, height=0.6, rotation=0.4)


def ask(
    gpu: Gpu, name: str, text: str, light: RectLight, points: np.ndarray, normals: np.ndarray | None = None
) -> np.ndarray:
    """Rows of ``fn at(p: vec3f, n: vec3f) -> vec4f`` in float64, for points (N, 3) and normals (3,) or (N, 3)."""
    points = np.asarray(points, float).reshape(-1, 3)
    towards = np.broadcast_to((0.0, 1.0, 0.0) if normals is None else normals, points.shape)
    rows = np.column_stack([points, np.arange(len(points))]).astype(np.float32)
    held = [
        gpu.buffer("test.lights", pack_lights(Scene(lights=[light]), gpu.dtype(LIGHT)), owner="test", element=LIGHT),
        gpu.buffer(
            "test.medium",
            np.array([pack_medium(Medium(), gpu.dtype(MEDIUM))]),
            owner="test",
            element=MEDIUM,
            usage="uniform",
        ),
        gpu.buffer(
            "test.normals",
            np.column_stack([towards, np.zeros(len(points))]).astype(np.float32),
            owner="test",
            element="vec4f",
        ),
    ]
    body = "fn evaluate(x: vec4f) -> vec4f { return at(x.xyz, normals[u32(x.w)].xyz); }\n"
    scope = {
        "lights": held[0].read().declaring(LIGHTS_RECT=True),
        "medium": held[1].uniform(),
        "normals": held[2].read(),
    }
    try:
        return props.evaluate(gpu, name, IMPORTS + text + body, rows, scope).astype(float)
    finally:
        for buffer in held:
            buffer.destroy()


COSINE = """
    fn at(p: vec3f, n: vec3f) -> vec4f {
        let arriving = incident(lights[0], medium, p);
        let above = towards_rect(lights[0], p, n);
        let exact = max(dot(n, above), 0.0) * arriving.irradiance.x;
        return vec4f(arriving.irradiance * max(dot(n, -arriving.direction), 0.0), exact);
    }
"""


def parallel(a: float, b: float, c: float) -> float:
    """Form factor from a small plane to a parallel rectangle a × b at a height c over its corner (Howell's B-3)."""
    x, y = a / c, b / c
    p, q = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    return (x / p * math.atan(y / p) + y / q * math.atan(x / q)) / (2 * math.pi)


def perpendicular(a: float, b: float, c: float) -> float:
    """The same to a rectangle that stands on the small plane's own plane: b along it, a up, at distance c (B-4)."""
    x, y = a / b, c / b
    return (math.atan(1 / y) - y / math.sqrt(x * x + y * y) * math.atan(1 / math.sqrt(x * x + y * y))) / (2 * math.pi)


def test_the_irradiance_of_planes_is_the_catalogues(gpu: Gpu) -> None:
    """π·L·F, under a corner, and under the middle as four times a quarter's; before a window, at its lower corner."""
    for number, (a, b, c) in enumerate([(1.0, 1.0, 1.0), (3.0, 0.2, 0.5), (0.1, 0.1, 5.0), (20.0, 20.0, 0.1)]):
        light = RectLight((a / 2, c, b / 2), (0, -1, 0), a * b, width=a, height=b)
        corner, middle = ask(gpu, f"test_parallel_{number}", COSINE, light, np.array([(0, 0, 0), (a / 2, 0, b / 2)]))
        for column in (0, 3):
            assert corner[column] == pytest.approx(math.pi * parallel(a, b, c), rel=2e-4)
            assert middle[column] == pytest.approx(4 * math.pi * parallel(a / 2, b / 2, c), rel=2e-4)
        window = RectLight((b / 2, a / 2, c), (0, 0, -1), a * b, width=b, height=a)
        (foot,) = ask(gpu, f"test_window_{number}", COSINE, window, np.array([(0, 0, 0)]))
        assert foot[0] == pytest.approx(math.pi * perpendicular(a, b, c), rel=3e-4)
        # The horizon through the middle of a window: the lower half gives nothing, and does not take away.
        half = replace(window, position=(b / 2, 0.0, c), height=2 * a, intensity=2 * a * b)
        (cut,) = ask(gpu, f"test_cut_{number}", COSINE, half, np.array([(0, 0, 0)]))
        assert cut[0] == pytest.approx(0, abs=1e-5)
        assert cut[3] == pytest.approx(math.pi * perpendicular(a, b, c), rel=3e-4)


def grid(light: RectLight, count: int = 400) -> np.ndarray:
    """Points (count², 3) that lie evenly on a rectangle."""
    across, along = light.axes
    at = (np.arange(count) + 0.5) / count * 2 - 1
    u, v = np.meshgrid(at, at)
    return np.array(light.position) + u[..., None].reshape(-1, 1) * across + v[..., None].reshape(-1, 1) * along


def summed(light: RectLight, p: np.ndarray, n: np.ndarray) -> tuple[float, np.ndarray, float]:
    """Above the horizon of n, by cosine; the vector irradiance of all; and the fluence: sums over the rectangle."""
    way = grid(light) - p
    distance = np.linalg.norm(way, axis=1)
    away = -np.array(light.direction) / np.linalg.norm(light.direction)
    each = light.intensity / len(way) * np.maximum(way @ away, 0) / distance**3
    towards = way / distance[:, None]
    return float((each * np.maximum(towards @ n, 0)).sum()), each @ towards, float(each.sum())


def places() -> tuple[np.ndarray, np.ndarray]:
    """Points around a light's front, near and far, and normals all around; many see the light cut by the horizon."""
    rng = np.random.default_rng(5)
    points = np.array(PANEL.position) + rng.normal(size=(120, 3)) * rng.choice([0.4, 1.0, 4.0, 30.0], (120, 1))
    height = (points - PANEL.position) @ PANEL.direction / np.linalg.norm(PANEL.direction)
    points = points[height > 0.1]
    normals = rng.normal(size=points.shape)
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_the_irradiance_is_the_sum_over_the_rectangles_points(gpu: Gpu) -> None:
    points, normals = places()
    vectors = """
        fn at(p: vec3f, n: vec3f) -> vec4f {
            let arriving = incident(lights[0], medium, p);
            return vec4f(-arriving.direction * arriving.irradiance.x, arriving.irradiance.y);
        }
    """
    air = """
        fn at(p: vec3f, n: vec3f) -> vec4f {
            let arriving = incident_in_air(lights[0], medium, p);
            return vec4f(arriving.direction, arriving.irradiance.x);
        }
    """
    got = ask(gpu, "test_rect_vectors", vectors, PANEL, points)
    above = ask(gpu, "test_rect_above", COSINE, PANEL, points, normals)
    around = ask(gpu, "test_rect_air", air, PANEL, points)
    cut = 0
    for row, over, scattered, p, n in zip(got, above, around, points, normals, strict=True):
        cosine, vector, fluence = summed(PANEL, p, n)
        size = float(np.linalg.norm(vector))
        np.testing.assert_allclose(row[:3], vector, atol=3e-4 * size)
        assert row[3] == pytest.approx(0.5 * size, rel=3e-4)
        assert over[3] == pytest.approx(cosine, abs=3e-4 * size)
        assert scattered[3] == pytest.approx(fluence, rel=3e-4)
        np.testing.assert_allclose(scattered[:3], -vector / size, atol=3e-4)
        cut += abs(cosine - max(float(vector @ n), 0.0)) > 1e-2 * size
    assert cut > 5, "some must see the light cut by their horizon"


def test_behind_it_is_dark(gpu: Gpu) -> None:
    both = """
        fn at(p: vec3f, n: vec3f) -> vec4f {
            let surface = incident(lights[0], medium, p).irradiance;
            return vec4f(surface.xy, incident_in_air(lights[0], medium, p).irradiance.xy);
        }
    """
    points, _ = places()
    towards = np.array(PANEL.direction) / np.linalg.norm(PANEL.direction)
    mirrored = points - 2 * ((points - PANEL.position) @ towards)[:, None] * towards
    assert (ask(gpu, "test_rect_front", both, PANEL, points) > 0).all()
    assert (ask(gpu, "test_rect_behind", both, PANEL, mirrored) == 0).all()


@pytest.mark.parametrize("shape", [(1.0, 1.0), (1.0, 0.01)])
def test_a_small_rectangle_is_a_point_with_a_cosine(gpu: Gpu, shape: tuple[float, float]) -> None:
    """I·cos θ/r², and ever nearer the smaller it is; also smaller than rounding."""
    points, _ = places()
    way = points - PANEL.position
    r = np.linalg.norm(way, axis=1)
    expected = PANEL.intensity * (way @ PANEL.direction) / np.linalg.norm(PANEL.direction) / r**3
    for size, error in ((0.1, 0.06), (0.01, 1e-3), (1e-4, 5e-4), (2e-6, 5e-4)):
        light = replace(PANEL, width=size * shape[0], height=max(size * shape[1], 1e-6))
        name = f"test_small_{-round(math.log10(size))}_{-round(math.log10(shape[1]))}"
        got = ask(gpu, name, COSINE, light, points, way / -r[:, None])
        np.testing.assert_allclose(got[:, 0], expected, rtol=error)
        np.testing.assert_allclose(got[:, 3], expected, rtol=error)


def test_a_turn_by_a_quarter_swaps_width_and_height(gpu: Gpu) -> None:
    points, normals = places()
    turned = replace(PANEL, width=PANEL.height, height=PANEL.width, rotation=PANEL.rotation + math.pi / 2)
    one, other = (
        ask(gpu, f"test_turned_{i}", COSINE, light, points, normals) for i, light in enumerate((PANEL, turned))
    )
    np.testing.assert_allclose(one, other, rtol=2e-4, atol=1e-5)
    upright = replace(PANEL, rotation=PANEL.rotation + math.pi / 2)
    assert np.abs(ask(gpu, "test_upright", COSINE, upright, points, normals) - one).max() > 0.01 * one.max()


def test_as_a_cone_it_is_as_bright(gpu: Gpu) -> None:
    """What takes it for a sphere sees E = π·L·sin²θ of the light's own, but near it; and nothing from behind."""
    text = """
        fn at(p: vec3f, n: vec3f) -> vec4f {
            let seen = seen_from(lights[0], p);
            return vec4f(seen.axis, seen.spread * (2.0 - seen.spread));
        }
    """
    points, _ = places()
    way = np.array(PANEL.position) - points
    r = np.linalg.norm(way, axis=1)
    got = ask(gpu, "test_rect_cone", text, PANEL, points)
    np.testing.assert_allclose(got[:, :3], way / r[:, None], atol=1e-5)
    cosine = -(way @ PANEL.direction) / np.linalg.norm(PANEL.direction) / r
    expected = np.minimum(PANEL.width * PANEL.height / math.pi * cosine / r**2, 1)
    np.testing.assert_allclose(got[:, 3], expected, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("direction", [(0, -1, 0), (0, 1, 0), (1, 0, 0), (0.3, -0.2, -2.0), (0.01, -1, 0)])
@pytest.mark.parametrize("rotation", [0.0, 0.7, -2.0])
def test_the_sides_are_square_to_each_other(direction: tuple[float, float, float], rotation: float) -> None:
    light = RectLight((1, 2, 3), direction, width=3.0, height=0.5, rotation=rotation)
    across, along = light.axes
    towards = np.array(direction) / np.linalg.norm(direction)
    assert np.linalg.norm(across) == pytest.approx(1.5)
    assert np.linalg.norm(along) == pytest.approx(0.25)
    np.testing.assert_allclose(np.cross(across, along), -1.5 * 0.25 * towards, atol=1e-12)
    assert light.extent == pytest.approx(math.sqrt(1.5 / math.pi))
    if rotation == 0 and abs(towards[1]) < 0.99:
        assert across[1] == pytest.approx(0, abs=1e-12)
        assert along[1] > 0


def test_a_turn_is_clockwise_as_the_light_travels() -> None:
    across, along = RectLight(direction=(0, 0, -1), width=2.0, height=2.0, rotation=0.1).axes
    # Seen along −Z, right is +X and up +Y: clockwise, the right end goes down.
    np.testing.assert_allclose(across, (math.cos(0.1), -math.sin(0.1), 0), atol=1e-12)
    np.testing.assert_allclose(along, (math.sin(0.1), math.cos(0.1), 0), atol=1e-12)
