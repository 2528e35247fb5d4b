"""A light that the horizon cuts: its form factor and points of it, against sums over its directions in float64."""

from __future__ import annotations

import math

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu

IMPORTS = """
    import package::wesl::horizon::{cosine_above, sample_above, towards_above};
    import package::wesl::light::Seen;
    const N = vec3f(0.6, 0.0, 0.8);
    fn seen(cosine: f32, spread: f32) -> Seen {
        return Seen(cosine * N + sqrt(1.0 - cosine * cosine) * vec3f(-0.8, 0.0, 0.6), spread, 1.0);
    }
"""
FRAME = np.array([[0.6, 0, 0.8], [-0.8, 0, 0.6], [0, -1, 0]])  # up, towards the light, aside


def spread_of(half: float) -> float:
    return 2 * math.sin(half / 2) ** 2


def directions(half: float, zenith: float, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Directions (N, 3) in FRAME over a cone, and the irradiance by each, of a light that gives a facing surface 1."""
    i = np.arange(count * count)
    height = spread_of(half) * ((i // count) + 0.5) / count
    angle = 2 * math.pi * ((i % count) + 0.5) / count
    across = np.sqrt(height * (2 - height))
    c, s = math.cos(zenith), math.sin(zenith)
    up = (1 - height) * c + across * np.cos(angle) * s
    level = (1 - height) * s - across * np.cos(angle) * c
    return np.stack([up, level, across * np.sin(angle)], 1), np.maximum(up, 0) * 2 / (2 - spread_of(half)) / len(i)


def form_factor(half: float, zenith: float) -> float:
    """What a surface receives of a light that gives a facing one 1: the sum over rings round the light's centre, of
    each of which the part above the horizon is a closed form.
    """
    height = spread_of(half) * (np.arange(100000) + 0.5) / 100000
    a, b = (1 - height) * math.cos(zenith), np.sqrt(height * (2 - height)) * math.sin(zenith)
    angle = np.arccos(np.clip(-a / b, -1, 1))
    return float(((a * angle + b * np.sin(angle)) / math.pi).mean() * 2 / (2 - spread_of(half)))


HALVES = [1e-4, 0.0047, 0.05, 0.25, 1.0, 1.5]
PLACES = [-0.9, -0.5, 0.0, 0.3, 0.8, 0.99, 1.1]  # sine of the centre's elevation over that of the half angle
CASES = [(half, math.acos(p * math.sin(half))) for half in HALVES for p in PLACES if p * math.sin(half) < 1]


def test_the_form_factor_above_the_horizon(gpu: Gpu) -> None:
    text = (
        IMPORTS
        + """
        fn evaluate(x: vec4f) -> vec4f {
            return vec4f(towards_above(N, seen(x.x, x.y)), cosine_above(N, seen(x.x, x.y)));
        }
    """
    )
    rows = np.array([(math.cos(zenith), spread_of(half), 0, 0) for half, zenith in CASES], np.float32)
    got = props.evaluate(gpu, "test_form_factor", text, rows).astype(float)
    for (half, zenith), row in zip(CASES, got, strict=True):
        # Directions themselves are rounded by 1e-7.
        assert row[3] == pytest.approx(form_factor(half, zenith), rel=2e-3, abs=1e-7 + 2e-5 * math.sin(half))
        assert row[:3] @ FRAME[0] == pytest.approx(row[3], rel=1e-4, abs=1e-6)
        assert row[:3] @ FRAME[2] == pytest.approx(0, abs=1e-6)
        assert np.linalg.norm(row[:3]) == pytest.approx(1, abs=1e-5)


def test_points_above_the_horizon_are_as_dense_as_the_irradiance(gpu: Gpu) -> None:
    """What straight edges hide, lying, standing and upright, of what a facing surface would receive: by points, and by
    sums over directions. Exact but for the density along the lune.
    """
    text = (
        IMPORTS
        + """
        fn evaluate(x: vec4f) -> vec4f {
            return vec4f(sample_above(N, seen(x.x, x.y), x.zw), 0.0);
        }
    """
    )
    n = 64
    u = np.stack(np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n), -1).reshape(-1, 2)
    cases = [np.column_stack([np.tile((math.cos(z), spread_of(h)), (len(u), 1)), u]) for h, z in CASES]
    rows = np.concatenate(cases).astype(np.float32)
    points = props.evaluate(gpu, "test_above", text, rows)[:, :3].astype(float) @ FRAME.T
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=1e-5)
    assert (points[:, 0] > -1e-6).all()
    for (half, zenith), got in zip(CASES, np.split(points, len(CASES)), strict=True):
        truth, weight = directions(half, zenith)
        received, size = weight.sum(), math.sin(half)
        axes = (0, 1, 2) if half >= 0.05 else (0, 2)  # a small light's depth is lost in rounding
        for axis in axes:
            order = np.argsort(truth[:, axis])
            below = np.cumsum(weight[order]) / received
            for part in (0.1, 0.3, 0.5, 0.7, 0.9):
                edge = truth[order[np.searchsorted(below, part)], axis]
                error = ((got[:, axis] < edge).mean() - part) * received / size
                assert abs(error) < (0.01 if half < 0.5 else 0.025)
