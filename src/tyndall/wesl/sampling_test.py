"""Sample points are even in the strata they promise, and directions have the densities they name."""

from __future__ import annotations

import numpy as np
import props
import pytest

from tyndall.frame import pack_medium
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Gibbons, HenyeyGreenstein, Isotropic, Medium, Phase, Rayleigh, Schlick

SEQUENCE = """
    import package::wesl::sampling::{sequence_1d, sequence_2d};
    fn evaluate(x: vec4f) -> vec4f {
        let pair = sequence_2d(u32(x.x), u32(x.y), u32(x.z));
        return vec4f(pair, sequence_1d(u32(x.x), u32(x.y), u32(x.z)), 0.0);
    }
"""


def sequence(gpu: Gpu, count: int, dimension: int, seed: int) -> np.ndarray:
    rows = np.stack([np.arange(count), *(np.full(count, x) for x in (dimension, seed, 0))], axis=1)
    name = f"test_sequence_{count}_{dimension}_{seed}"
    return props.evaluate(gpu, name, SEQUENCE, rows)[:, :3].astype(float)


@pytest.mark.parametrize(("dimension", "seed"), [(0, 0), (3, 77), (11, 4_000_037)])
def test_every_stratum_holds_one_point(gpu: Gpu, dimension: int, seed: int) -> None:
    """2^k consecutive points from 0 on: one in each interval of 2^-k, and one in each binary box of area 2^-k."""
    points = sequence(gpu, 256, dimension, seed)
    assert points.min() >= 0
    assert points.max() < 1
    for k in range(1, 9):
        first = points[: 2**k]
        assert sorted(np.floor(first[:, 2] * 2**k)) == list(range(2**k))
        for a in range(k + 1):
            boxes = np.floor(first[:, 0] * 2**a) * 2 ** (k - a) + np.floor(first[:, 1] * 2 ** (k - a))
            assert sorted(boxes) == list(range(2**k)), (k, a)


def test_places_within_strata_are_independent(gpu: Gpu) -> None:
    """Over seeds, where a point lies in its stratum says nothing of where the others lie in theirs."""
    seeds, count = 1000, 64
    rows = np.zeros((seeds * count, 4))
    rows[:, 0], rows[:, 2] = np.tile(np.arange(count), seeds), np.repeat(np.arange(seeds), count)
    points = props.evaluate(gpu, "test_strata", SEQUENCE, rows)[:, :3].astype(float).reshape(seeds, count, 3)
    for axis in range(3):
        places = np.sort(points[:, :, axis], axis=1) * count - np.arange(count)
        assert np.abs(places.mean(axis=0) - 0.5).max() < 4.5 / np.sqrt(12 * seeds)
        table = np.corrcoef(places.T) - np.eye(count)
        assert np.abs(table).max() < 5.5 / np.sqrt(seeds)


def test_a_smooth_integral_converges_faster_than_at_random(gpu: Gpu) -> None:
    """∫ sin²(3x) e^y over the unit square with 1024 points of eight scramblings."""
    exact = (0.5 - np.sin(6) / 12) * (np.e - 1)
    found = []
    for seed in range(8):
        x, y, _ = sequence(gpu, 1024, 5, seed).T
        found.append((np.sin(3 * x) ** 2 * np.exp(y)).mean())
    spread = np.std(np.sin(3 * x) ** 2 * np.exp(y)) / np.sqrt(1024)
    assert np.sqrt(np.mean((np.array(found) - exact) ** 2)) < spread / 8
    assert len(set(found)) == 8, "another seed is another scrambling"


def test_dimensions_are_independent(gpu: Gpu) -> None:
    """Padded dimensions have no correlation beyond chance, and neither have two seeds."""
    columns = [sequence(gpu, 1024, d, s)[:, [0, 1, 2]] for d, s in ((0, 1), (1, 1), (2, 1), (0, 2))]
    table = np.corrcoef(np.concatenate(columns, axis=1).T)
    off = np.abs(table - np.diag(np.diag(table)))
    # Within one dimension's triple the 1-D point may share its shuffle with the pair: they are alternatives.
    blocks = np.kron(np.eye(4), np.ones((3, 3))) > 0
    assert off[~blocks].max() < 4.5 / np.sqrt(1024)


DIRECTIONS = """
    import package::wesl::sampling::{sample_cap, sample_cone, sample_cosine, sample_disk, sample_sphere, sequence_2d};
    const AXIS = vec3f(0.48, -0.6, -0.64);
    fn evaluate(x: vec4f) -> vec4f {
        let u = sequence_2d(u32(x.x), 1u, 9u);
        switch u32(x.y) {
            case 0u: { return vec4f(sample_cone(AXIS, 0.75, u), 0.0); }
            case 1u: { return vec4f(sample_cap(AXIS, 1e-6, u), 0.0); }
            case 2u: { return vec4f(sample_cosine(AXIS, u), 0.0); }
            case 3u: { return vec4f(sample_sphere(u), 0.0); }
            default: { return vec4f(sample_disk(u), 0.0, 0.0); }
        }
    }
"""
AXIS = np.array([0.48, -0.6, -0.64])
COUNT = 4096


def directions(gpu: Gpu, case: int) -> np.ndarray:
    rows = np.stack([np.arange(COUNT), np.full(COUNT, case), np.zeros(COUNT), np.zeros(COUNT)], axis=1)
    return props.evaluate(gpu, f"test_directions_{case}", DIRECTIONS, rows)[:, :3].astype(float)


def assert_uniform(values: np.ndarray) -> None:
    """0 … 1, evenly, to well below the scatter of as many random numbers."""
    ranks = (np.arange(len(values)) + 0.5) / len(values)
    assert np.abs(np.sort(values) - ranks).max() < 0.4 / np.sqrt(len(values))


def azimuth(d: np.ndarray, axis: np.ndarray) -> np.ndarray:
    side = np.cross(axis, (0.0, 1.0, 0.0))
    side /= np.linalg.norm(side)
    return np.arctan2(d @ np.cross(axis, side), d @ side) / (2 * np.pi) + 0.5


def test_directions_have_their_densities(gpu: Gpu) -> None:
    cone, narrow, cosine, sphere, disk = (directions(gpu, case) for case in range(5))
    for d in (cone, narrow, cosine, sphere):
        np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-5)
    assert_uniform((1 - cone @ AXIS) / 0.25)
    assert_uniform(azimuth(cone, AXIS))
    across = np.linalg.norm(np.cross(narrow, AXIS), axis=1)
    assert_uniform(across**2 / (1e-6 * (2 - 1e-6)))
    assert_uniform((cosine @ AXIS) ** 2)
    assert_uniform(azimuth(cosine, AXIS))
    assert_uniform(0.5 + 0.5 * sphere[:, 2])
    assert_uniform(0.5 + 0.5 * sphere[:, 0])
    assert_uniform((disk[:, :2] ** 2).sum(axis=1))


def test_a_basis_is_right_handed_everywhere(gpu: Gpu) -> None:
    text = """
        import package::wesl::sampling::basis;
        fn evaluate(x: vec4f) -> vec4f {
            let m = basis(x.xyz);
            let gram = transpose(m) * m;
            let off = max(abs(gram[0] - vec3f(1, 0, 0)), abs(gram[1] - vec3f(0, 1, 0)));
            let worst = max(off, abs(gram[2] - vec3f(0, 0, 1)));
            return vec4f(max(worst.x, max(worst.y, worst.z)), determinant(m), dot(m[2], x.xyz), 0.0);
        }
    """
    rng = np.random.default_rng(1)
    n = np.concatenate([rng.normal(size=(500, 3)), np.eye(3), -np.eye(3), [[1e-4, 0, -1], [0, 1e-4, 1]]])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    got = props.evaluate(gpu, "test_basis", text, np.concatenate([n, np.zeros((len(n), 1))], axis=1))
    assert got[:, 0].max() < 5e-6
    np.testing.assert_allclose(got[:, 1:3], 1, atol=5e-6)


@pytest.mark.parametrize("g", [0.0, 0.0005, 0.5, -0.7, 0.95])
def test_henyey_greenstein_is_sampled_exactly(gpu: Gpu, g: float) -> None:
    """The samples' cumulative distribution is that of the phase function; the mean cosine is g."""
    text = """
        import package::wesl::sampling::sample_henyey_greenstein;
        fn evaluate(x: vec4f) -> vec4f {
            return vec4f(sample_henyey_greenstein(x.y, x.x));
        }
    """
    u = (np.arange(COUNT) + 0.5) / COUNT
    rows = np.stack([u, np.full(COUNT, g), u, u], axis=1)
    cosine = props.evaluate(gpu, f"test_hg_{int(1e4 * abs(g))}", text, rows)[:, 0].astype(float)
    assert cosine.mean() == pytest.approx(g, abs=2e-3)
    if abs(g) > 1e-2:
        below = (1 - g * g) / (2 * g) * (1 / np.sqrt(1 + g * g - 2 * g * cosine) - 1 / (1 + g))
        assert_uniform(below)
    else:
        assert_uniform(0.5 + 0.5 * cosine)


@pytest.mark.parametrize(
    "model", [Isotropic(), HenyeyGreenstein(0.6), Rayleigh(), Gibbons(), Schlick(0.0), Schlick(-0.8)]
)
def test_every_phase_function_is_sampled_exactly(gpu: Gpu, model: Phase) -> None:
    """The cumulative distribution of the samples is that of the phase function, by quadrature."""
    text = """
        import package::wesl::sampling::sample_phase;
        fn evaluate(x: vec4f) -> vec4f {
            return vec4f(sample_phase(u32(x.y), x.z, x.x));
        }
    """
    row = pack_medium(Medium(phase=model), gpu.dtype("package::wesl::medium::Medium"))
    u = (np.arange(COUNT) + 0.5) / COUNT
    rows = np.stack([u, np.full(COUNT, row["phase_kind"]), np.full(COUNT, row["phase_parameter"]), u], axis=1)
    cosine = props.evaluate(gpu, f"test_phase_samples_{model.kind}_{row['phase_parameter'] < 0}", text, rows)[:, 0]
    edges = np.linspace(-1, 1, 20_001)
    middle = (edges[1:] + edges[:-1]) / 2
    below = np.concatenate([[0], np.cumsum(2 * np.pi * props.phase(model, middle) * np.diff(edges))])
    assert_uniform(np.interp(cosine.astype(float), edges, below))


@pytest.mark.parametrize("alpha", [0.05, 0.6])
def test_visible_normals_have_their_density(gpu: Gpu, alpha: float) -> None:
    """Moments of the samples equal those of G1·D·max(v·h, 0) by quadrature over the hemisphere."""
    text = """
        import package::wesl::sampling::{sample_visible_normal, sequence_2d};
        fn evaluate(x: vec4f) -> vec4f {
            return vec4f(sample_visible_normal(vec3f(0.0, 0.0, 1.0), normalize(vec3f(0.8, 0.0, 0.6)), x.y,
                sequence_2d(u32(x.x), 2u, 3u)), 0.0);
        }
    """
    rows = np.stack([np.arange(COUNT), np.full(COUNT, alpha), np.zeros(COUNT), np.zeros(COUNT)], axis=1)
    h = props.evaluate(gpu, f"test_vndf_{int(100 * alpha)}", text, rows)[:, :3].astype(float)
    np.testing.assert_allclose(np.linalg.norm(h, axis=1), 1, atol=1e-5)
    v = np.array([0.8, 0.0, 0.6])
    # Quadrature over the hemisphere in tan θ = alpha·s/sqrt(1−s²), which follows D.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    s2, w = (nodes + 1) / 2, weights / 2
    theta = np.arctan(alpha * np.sqrt(s2 / (1 - s2)))
    phi = (np.arange(256) + 0.5) / 256 * 2 * np.pi
    t, p = np.meshgrid(theta, phi, indexing="ij")
    grid = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    # With s² uniform, D·cosθ·dω = ds² dφ/(2π); the visible density is G1·D·max(v·h,0)/v.z.
    weight = (w[:, None] / 256) * np.maximum(grid @ v, 0) / np.cos(t)
    weight /= weight.sum()
    for f in (lambda m: m[..., 0], lambda m: m[..., 2], lambda m: m[..., 0] ** 2, lambda m: m[..., 1] ** 2):
        assert f(h).mean() == pytest.approx((weight * f(grid)).sum(), abs=2e-3 * np.sqrt(alpha))
