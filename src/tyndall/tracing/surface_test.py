"""What a ray finds at a pixel is what the G-buffer holds there: material, textures, normals, however it is placed."""

from __future__ import annotations

import math

import numpy as np
import props
import pytest

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, Image, Instance, Material, Mesh, Scene, Texture
from tyndall.techniques.shadow import ShadowMap

SIZE = (96, 64)
CAMERA = Camera((0.3, 0.4, 4.0), (0.0, 0.1, 0.0), fov=math.radians(40))
_PROBE = """
import package::tracing::rays::{RayHit, closest};
import package::tracing::surface::{TracedSurface, surface_at};
import package::wesl::camera::FAR;
fn evaluate(x: vec4f) -> vec4f {
    let origin = vec3f(0.3, 0.4, 4.0);
    let hit = closest(origin, x.xyz, 0.0, FAR, true);
    if hit.t >= FAR {
        return vec4f(0.0);
    }
    let s = surface_at(hit, origin, x.xyz);
    if x.w == 0.0 {
        return vec4f(s.surface.normal, s.surface.roughness);
    }
    if x.w == 1.0 {
        return vec4f(s.surface.albedo, s.surface.metallic);
    }
    if x.w == 2.0 {
        return vec4f(s.emissive, 1.0);
    }
    if x.w == 3.0 {
        return vec4f(s.position, hit.t);
    }
    return vec4f(s.geometric, 1.0);
}
"""


def textures() -> dict[str, Texture]:
    """Smooth pictures, so that a filter's last bits do not matter; each wrapped, turned and scaled in its own way."""
    rng = np.random.default_rng(4)
    y, x = np.mgrid[0:16, 0:16] / 16 * 2 * np.pi
    made = {}
    for i, name in enumerate(("base_color", "metallic_roughness", "normal", "emissive")):
        waves = [0.5 + 0.4 * np.sin(x * (1 + (i + c) % 2) + rng.uniform(0, 6)) * np.cos(y + c) for c in range(4)]
        pixels = np.rint(255 * np.stack(waves, axis=-1)).astype(np.uint8)
        if name == "normal":
            pixels[..., 2] = 230
        wrap = ("repeat", "clamp", "mirror")
        made[f"{name}_texture"] = Texture(
            Image(pixels),
            wrap[i % 3],
            wrap[(i + 1) % 3],
            offset=(0.1 * i, 0.2),
            rotation=0.3 * i,
            scale=(1.2, 0.8 + 0.2 * i),
        )
    return made


def textured(**changes: object) -> Material:
    factors = {"base_color": (0.9, 0.7, 0.8, 1.0), "metallic": 0.7, "roughness": 0.9, "emissive": (2.0, 1.0, 0.5)}
    return Material(**{**factors, **textures(), **changes})  # type: ignore[arg-type]


def ball(material: Material) -> Mesh:
    """A sphere with smooth normals and texture coordinates."""
    v, u = np.mgrid[0:13, 0:25]
    theta, phi = v / 12 * np.pi, u / 24 * 2 * np.pi
    points = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), -np.sin(theta) * np.sin(phi)], axis=-1)
    quads = [(r * 25 + c, (r + 1) * 25 + c, (r + 1) * 25 + c + 1, r * 25 + c + 1) for r in range(12) for c in range(24)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    uvs = np.stack([u / 24, v / 12], axis=-1).reshape(-1, 2).astype(np.float32)
    points = points.reshape(-1, 3).astype(np.float32)
    return Mesh(points, np.array(triangles, np.uint32), normals=points, uvs=uvs, material=material)


def at(x: float, scale: tuple[float, float, float], turn: float = 0.4) -> tuple[tuple[float, ...], ...]:
    c, s = math.cos(turn), math.sin(turn)
    matrix = np.array([[c, 0, s, x], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]]) @ np.diag([*scale, 1.0])
    return tuple(tuple(float(n) for n in row) for row in matrix)


SCENES = {
    "placed once": lambda m: [Instance(m, at(-0.6, (0.7, 0.9, 0.6)))],
    "shared": lambda m: [Instance(m, at(x, (0.5, 0.9, 0.6), x)) for x in (-0.8, 0.8)],
    "mirrored": lambda m: [Instance(m, at(0.2, (-0.7, 0.9, 0.8)))],
    "mirrored and shared": lambda m: [Instance(m, at(x, (0.6, -0.8, 0.6), x)) for x in (-0.8, 0.8)],
}


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize(
    "material",
    [
        pytest.param(textured(), id="textured"),
        pytest.param(textured(alpha_mode="mask", alpha_cutoff=0.45, double_sided=True), id="masked"),
        pytest.param(
            Material(base_color=(0.2, 0.5, 0.9, 1), metallic=0.3, roughness=0.4, emissive=(0.1, 3, 0.2)), id="plain"
        ),
    ],
)
def test_a_ray_finds_what_the_g_buffer_holds(gpu: Gpu, kind: str, material: Material) -> None:
    scene = Scene(SCENES[kind](ball(material)), camera=CAMERA)
    rays = props.rays(CAMERA, SIZE).directions.reshape(-1, 3)
    with Renderer(scene, SIZE, gpu=gpu, volumetric="off", shadow=ShadowMap(size=16), antialiasing="none") as renderer:
        renderer.draw()
        names = ("normal_roughness", "albedo_metallic", "emissive")
        drawn = [gpu.read_texture(renderer._images[name]).reshape(-1, 4).astype(float) for name in names]
        depth = renderer.depth().reshape(-1)
        rows = np.concatenate([np.column_stack([rays, np.full(len(rays), w)]) for w in range(5)]).astype(np.float32)
        found = props.evaluate(gpu, "surface_probe", _PROBE, rows, renderer.world.bindings)
        found = found.reshape(5, -1, 4).astype(float)
    there = np.isfinite(depth)
    hit = found[3, :, 3] > 0
    assert 0.1 < there.mean() < 0.95
    assert (there == hit).mean() > 0.995  # edges
    both = there & hit
    # Away from edges of holes and of triangles' silhouettes, where neighbouring pixels see the same surface.
    picture = drawn[0].reshape(SIZE[1], SIZE[0], 4)
    steps = np.abs(np.diff(picture[..., :3], axis=1, prepend=picture[:, :1, :3])).max(axis=-1).reshape(-1)
    calm = both & (steps < 0.3)
    normals = np.sum(drawn[0][:, :3] * found[0][:, :3], axis=1)
    assert np.percentile(normals[calm], 2) > 0.995
    np.testing.assert_allclose(np.percentile(np.abs(drawn[0][calm, 3] - found[0][calm, 3]), 98), 0, atol=0.01)
    albedo = drawn[1] / 255  # its root
    assert np.percentile(np.abs(albedo[calm, :3] ** 2 - found[1][calm, :3]), 98) < 0.012
    assert np.percentile(np.abs(albedo[calm, 3] - found[1][calm, 3]), 98) < 0.012
    assert np.percentile(np.abs(drawn[2][calm, :3] - found[2][calm, :3]), 98) < 0.02 * max(material.emissive)
    forward = np.subtract(CAMERA.target, CAMERA.position)
    along = (found[3][both, :3] - CAMERA.position) @ (forward / np.linalg.norm(forward))
    assert np.percentile(np.abs(along / depth[both] - 1), 98) < 1e-4
    assert (np.sum(found[4][both, :3] * rays[both], axis=1) <= 0).all()
    assert np.allclose(np.linalg.norm(found[4][both, :3], axis=1), 1, atol=1e-4)
