"""The pure shader functions, run on the device and held against the definitions in float64."""

from __future__ import annotations

import math

import numpy as np
import props
import pytest

from tyndall.frame import pack_camera, pack_lights
from tyndall.gpu.device import Gpu
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Gibbons,
    HenyeyGreenstein,
    Isotropic,
    Light,
    Material,
    Phase,
    PointLight,
    Rayleigh,
    Scene,
    Schlick,
    SpotLight,
)

PHASES: list[tuple[int, float, Phase]] = [
    (0, 0.0, Isotropic()),
    (1, 0.0, HenyeyGreenstein(0.0)),
    (1, 0.9, HenyeyGreenstein(0.9)),
    (1, -0.6, HenyeyGreenstein(-0.6)),
    (1, 0.99, HenyeyGreenstein(0.99)),
    (2, 0.0, Rayleigh()),
    (3, 0.0, Gibbons()),
    (4, 0.8, Schlick(0.8)),
    (4, -0.99, Schlick(-0.99)),
]

PHASE = """
    import package::wesl::phase::phase;
    fn evaluate(x: vec4f) -> vec4f {
        return vec4f(phase(u32(x.x), x.y, x.z));
    }
"""


def test_phase_functions_integrate_to_one(gpu: Gpu) -> None:
    """∫ p dω = 2π ∫ p(cosθ) dcosθ, by Gauss–Legendre in a variable that crowds towards both peaks."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    # cosθ = sin(πu/2): dcosθ = π/2 cos(πu/2) du.
    cosine, jacobian = np.sin(np.pi / 2 * nodes), np.pi / 2 * np.cos(np.pi / 2 * nodes)
    rows = np.concatenate([np.stack([np.full(400, k), np.full(400, p), cosine, cosine], axis=1) for k, p, _ in PHASES])
    values = props.evaluate(gpu, "test_phase", PHASE, rows)[:, 0].reshape(len(PHASES), 400)
    for value, (_, _, model) in zip(values, PHASES, strict=True):
        np.testing.assert_allclose(value, props.phase(model, cosine), rtol=2e-3, err_msg=str(model))
        assert 2 * np.pi * (value * weights * jacobian).sum() == pytest.approx(1, abs=1e-3), model


def test_forward_scattering_is_at_cosine_one(gpu: Gpu) -> None:
    rows = np.array([[1, 0.5, 1, 0], [1, 0.5, -1, 0], [4, 0.5, 1, 0], [4, 0.5, -1, 0], [3, 0, 1, 0], [3, 0, -1, 0]])
    forward_hg, back_hg, forward_s, back_s, forward_g, back_g = props.evaluate(gpu, "test_phase_ends", PHASE, rows)[
        :, 0
    ]
    assert forward_hg / back_hg == pytest.approx(27, rel=1e-4)
    assert forward_s / back_s == pytest.approx(9, rel=1e-4)
    assert forward_g / back_g == pytest.approx(10, rel=1e-4)


def test_a_slab_is_exact_at_every_thickness(gpu: Gpu) -> None:
    """(1 − e^(−σs))/σ, through the change from series to closed form, and finite for nothing and for everything."""
    text = """
        import package::wesl::medium::slab;
        fn evaluate(x: vec4f) -> vec4f {
            return vec4f(slab(vec3f(x.x, x.x * 0.5, 0.0), x.y), 0.0);
        }
    """
    sigma, length = (
        a.ravel() for a in np.meshgrid([0, 1e-12, 1e-6, 1e-3, 0.02, 0.1, 3, 1e3], [0, 1e-6, 0.2, 1, 50, 1e9])
    )
    got = props.evaluate(gpu, "test_slab", text, np.stack([sigma, length, sigma, sigma], axis=1))
    for channel, factor in ((0, 1.0), (1, 0.5), (2, 0.0)):
        s = np.float32(sigma * factor).astype(float)
        expected = np.where(s > 0, -np.expm1(-s * length) / np.where(s > 0, s, 1), length)
        np.testing.assert_allclose(got[:, channel], expected, rtol=2e-5, atol=1e-30)


def test_where_a_ray_is_inside_a_box(gpu: Gpu) -> None:
    text = """
        import package::wesl::medium::{Medium, medium_interval};
        fn evaluate(x: vec4f) -> vec4f {
            var m: Medium;
            m.lower = vec3f(-1.0, -2.0, -3.0);
            m.upper = vec3f(1.0, 2.0, 3.0);
            let origin = vec3f(0.5, 0.25, 5.0) * x.w;
            let inside = medium_interval(m, origin, normalize(x.xyz), 20.0);
            let near = medium_interval(m, origin, normalize(x.xyz), 0.5);
            return vec4f(inside, near);
        }
    """
    rng = np.random.default_rng(3)
    directions = np.concatenate([rng.normal(size=(60, 3)) + (0, 0, -1.5), np.eye(3), -np.eye(3)])
    for scale in (0.0, 0.3, 1.0):
        rows = np.concatenate([directions, np.full((len(directions), 1), scale)], axis=1)
        got = props.evaluate(gpu, f"test_interval_{int(10 * scale)}", text, rows)
        unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        enter, leave = props.hit_box(np.array([0.5, 0.25, 5.0]) * scale, unit, (-1, -2, -3), (1, 2, 3))
        for columns, limit in ((got[:, :2], 20.0), (got[:, 2:], 0.5)):
            begin = np.maximum(enter, 0)
            end = np.maximum(np.minimum(leave, limit), begin)
            inside = end > begin
            assert inside.any() or (scale == 1 and limit == 0.5)
            np.testing.assert_allclose(columns[inside], np.stack([begin, end], 1)[inside], rtol=1e-4, atol=1e-4)
            assert np.allclose(columns[~inside, 0], columns[~inside, 1])


SEEN = """
    import package::wesl::light::{DIRECTIONAL, POINT, Light, seen_from};
    fn evaluate(x: vec4f) -> vec4f {
        var light: Light;
        light.kind = select(POINT, DIRECTIONAL, x.z < 0.0);
        light.direction = vec3f(0.0, -1.0, 0.0);
        light.position = vec3f(2.0, 3.0, 1.0);
        light.radius = x.x;
        let p = light.position + vec3f(0.36, 0.48, -0.8) * x.y;
        let seen = seen_from(light, p);
        return vec4f(seen.spread, seen.reach, dot(seen.axis, vec3f(-0.36, -0.48, 0.8)), seen.axis.y);
    }
"""


def test_a_sphere_fills_the_cone_of_its_tangents(gpu: Gpu) -> None:
    """sin θ = r/d, for the smallest angles too, where 1 − cos θ is below a cosine's last bit; inside a half space."""
    radius, distance = (a.ravel() for a in np.meshgrid([0, 1e-5, 1e-3, 0.1, 1.0, 5.0], [0.5, 1.5, 40.0]))
    rows = np.stack([radius, distance, np.ones_like(radius), radius], axis=1)
    got = props.evaluate(gpu, "test_seen_sphere", SEEN, rows)
    outside = radius < distance
    half = np.arcsin(np.where(outside, radius / distance, 1))
    np.testing.assert_allclose(got[:, 0], np.where(outside, 2 * np.sin(half / 2) ** 2, 1), rtol=1e-4, atol=1e-12)
    assert (got[:, 1] < distance).all(), "the ray ends before what the light is part of"
    np.testing.assert_allclose(got[:, 1], distance, rtol=1e-4)
    np.testing.assert_allclose(got[:, 2], 1, atol=1e-5)


@pytest.mark.parametrize("light", [DirectionalLight(), PointLight(), SpotLight()])
def test_a_light_without_a_radius_fills_nothing(gpu: Gpu, light: Light) -> None:
    (row,) = pack_lights(Scene(lights=[light]), gpu.dtype("package::wesl::light::Light"))
    assert row["radius"] == 0


@pytest.mark.parametrize("angle", [0.0, 1e-4, 0.0093, 0.5, 3.0])
def test_a_directional_light_fills_its_angle(gpu: Gpu, angle: float) -> None:
    light = DirectionalLight((0, -1, 0), angular_diameter=angle)
    (row,) = pack_lights(Scene(lights=[light]), gpu.dtype("package::wesl::light::Light"))
    got = props.evaluate(gpu, f"test_seen_sun_{angle:g}".replace(".", "_").replace("-", "_"), SEEN,
                         np.array([[row["radius"], 1, -1, 0]]))  # fmt: skip
    assert got[0, 0] == pytest.approx(2 * math.sin(angle / 4) ** 2, rel=1e-5)
    assert got[0, 1] == 1e9
    assert got[0, 3] == 1


BRDF = """
    import package::wesl::brdf::{Surface, reflect_light};
    fn direction(cosine: f32, azimuth: f32) -> vec3f {
        let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
        return vec3f(sine * cos(azimuth), sine * sin(azimuth), cosine);
    }
    fn evaluate(x: vec4f) -> vec4f {
        let surface = Surface(vec3f(0.0, 0.0, 1.0), vec3f(ALBEDO), METALLIC, ROUGHNESS);
        let v = direction(x.x, 0.0);
        let l = direction(x.y, x.z);
        return vec4f(reflect_light(surface, v, l).x / x.y, reflect_light(surface, l, v).x / x.x, 0.0, 0.0);
    }
"""


def brdf(gpu: Gpu, name: str, rows: np.ndarray, albedo: float, metallic: float, roughness: float) -> np.ndarray:
    text = f"const ALBEDO = {albedo}f;\nconst METALLIC = {metallic}f;\nconst ROUGHNESS = {roughness}f;\n"
    lines = BRDF.strip().split("\n", 1)
    return props.evaluate(gpu, name, f"{lines[0]}\n{text}{lines[1]}", rows).astype(float)


@pytest.mark.parametrize(("metallic", "roughness"), [(0, 0.3), (0, 1.0), (1, 0.3), (1, 0.9), (0.5, 0.6)])
def test_reflection_is_reciprocal_and_loses_energy(gpu: Gpu, metallic: float, roughness: float) -> None:
    """f(v, l) = f(l, v), and ∫ f cosθ dω ≤ 1 for a white surface, by quadrature over the hemisphere."""
    views = np.array([0.15, 0.5, 0.9, 1.0])
    nodes, weights = np.polynomial.legendre.leggauss(96)
    cosine, dcos = (nodes + 1) / 2, weights / 2
    azimuth = (np.arange(192) + 0.5) / 192 * 2 * np.pi
    v, l, phi = (a.ravel() for a in np.meshgrid(views, cosine, azimuth, indexing="ij"))
    name = f"test_brdf_{int(10 * metallic)}_{int(10 * roughness)}"
    got = brdf(gpu, name, np.stack([v, l, phi, phi], axis=1), 1.0, metallic, roughness)
    np.testing.assert_allclose(got[:, 0], got[:, 1], rtol=2e-3, atol=1e-6)

    def unit(c: np.ndarray, a: np.ndarray | float) -> np.ndarray:
        s = np.sqrt(1 - c * c)
        return np.stack(np.broadcast_arrays(s * np.cos(a), s * np.sin(a), c), axis=-1)

    material = Material(base_color=(1, 1, 1, 1), metallic=metallic, roughness=roughness)
    expected = props.reflected(material, (0, 0, 1), unit(v, 0.0), unit(l, phi))[:, 0] / l
    np.testing.assert_allclose(got[:, 0], expected, rtol=5e-3, atol=1e-5)
    energy = (got[:, 0].reshape(4, 96, 192).mean(axis=2) * cosine * dcos).sum(axis=1) * 2 * np.pi
    assert (energy < (1.03 if metallic == 0 else 1.002)).all(), energy
    # Single scattering between microfacets loses light of rough metals.
    assert (energy > (0.8 if metallic == 0 else 0.4)).all(), energy


def test_a_rough_dielectric_is_nearly_lambertian(gpu: Gpu) -> None:
    """At normal incidence a white rough surface is a Lambertian of albedo 0.96 under a little gloss."""
    row = np.array([[1.0, 1.0, 0.0, 0.0]])
    white = brdf(gpu, "test_brdf_white", row, 1.0, 0.0, 1.0)[0, 0]
    black = brdf(gpu, "test_brdf_black", row, 0.0, 0.0, 1.0)[0, 0]
    assert black == pytest.approx(0.04 / (4 * math.pi), rel=1e-3)
    assert white - black == pytest.approx(0.96 / math.pi, rel=1e-3)


def test_rays_and_projection_are_inverse(gpu: Gpu) -> None:
    """A pixel's ray, followed to a depth and projected, comes back to the pixel; and it is the defined ray."""
    camera = Camera((1, 2, 3), (-0.5, 1.0, -2), (0.1, 1, 0), fov=0.8, near=0.1)
    size = (33, 17)
    dtype = gpu.dtype("package::wesl::camera::Camera")
    row = pack_camera(camera, Scene(), size, dtype)
    uniform = gpu.buffer(
        "test.camera", np.array([row]), owner="test", element="package::wesl::camera::Camera", usage="uniform"
    )
    count = size[0] * size[1]
    out = gpu.buffer("test.out", 32 * count, owner="test", element="vec4f")
    text = """
        import package::bindings::{camera, out};
        import package::wesl::camera::{ray_through, project, distance_along};
        @compute @workgroup_size(8, 8)
        fn main(@builtin(global_invocation_id) id: vec3u) {
            if any(id.xy >= camera.size) { return; }
            let pixel = vec2f(id.xy) + 0.5;
            let ray = ray_through(camera, pixel);
            let t = distance_along(camera, ray, 0.01);
            let back = project(camera, ray.origin + ray.direction * t);
            let i = 2u * (id.y * camera.size.x + id.x);
            out[i] = vec4f(ray.direction, ray.stretch);
            out[i + 1u] = vec4f(back, t);
        }
    """
    with props.module(gpu, "test_camera", text) as path:
        gpu.compute("test", path).bind(camera=uniform.uniform(), out=out.read_write()).dispatch(*size)
        got = gpu.read_buffer(out).view(np.float32).reshape(size[1], size[0], 2, 4)
    uniform.destroy()
    out.destroy()
    seen = props.rays(camera, size)
    np.testing.assert_allclose(got[..., 0, :3], seen.directions, atol=2e-6)
    np.testing.assert_allclose(got[..., 0, 3], seen.stretch, rtol=1e-5)
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    np.testing.assert_allclose(got[..., 1, 0], x, atol=2e-4)
    np.testing.assert_allclose(got[..., 1, 1], y, atol=2e-4)
    np.testing.assert_allclose(got[..., 1, 2], 10.0, rtol=1e-5)  # near/depth = 0.1/0.01
    np.testing.assert_allclose(got[..., 1, 3], 10 * seen.stretch, rtol=1e-5)


def test_noise_is_even(gpu: Gpu) -> None:
    """Interleaved gradient noise covers 0..1 in every 3×3 block, and its mean over frames is a half everywhere."""
    text = """
        import package::wesl::noise::{interleaved_gradient, pcg, unit_float};
        fn evaluate(x: vec4f) -> vec4f {
            return vec4f(interleaved_gradient(x.xy, u32(x.z)), unit_float(pcg(u32(x.w))), 0.0, 0.0);
        }
    """
    size, frames = 24, 64
    x, y, f = (a.ravel() for a in np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5, np.arange(frames)))
    got = props.evaluate(gpu, "test_noise", text, np.stack([x, y, f, np.arange(len(x))], axis=1)).astype(float)
    noise = got[:, 0].reshape(size, size, frames)
    assert noise.min() >= 0
    assert noise.max() < 1
    blocks = np.sort(noise[:, :, 0].reshape(8, 3, 8, 3).transpose(0, 2, 1, 3).reshape(64, 9), axis=1)
    gaps = np.diff(np.concatenate([blocks, blocks[:, :1] + 1], axis=1), axis=1)
    assert gaps.max() < 0.35, "nine neighbours leave no large gap"
    assert np.abs(noise.mean(axis=2) - 0.5).max() < 0.06
    hashed = got[:, 1]
    # Mean and variance of the uniform distribution, to four standard errors.
    assert abs(hashed.mean() - 0.5) < 4 * math.sqrt(1 / 12 / len(hashed))
    assert abs(hashed.var() - 1 / 12) < 4 * math.sqrt(1 / 180 / len(hashed))
    assert abs(np.corrcoef(hashed[:-1], hashed[1:])[0, 1]) < 4 / math.sqrt(len(hashed))
