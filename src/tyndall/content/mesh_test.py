"""Meshes in the G-buffer: transforms, normals, textures and holes, against the same looked up by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest
from props import AHEAD, WHITE, shoot

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.scene.model import DirectionalLight, Image, Instance, Material, Mesh, Scene, Texture
from tyndall.techniques.shadow.shadow_map import ShadowMap

SIZE = (48, 36)
SUN = DirectionalLight((0.3, -0.5, -0.8), 2.0)
WALL = props.quad((-2, -1.5, -4), (2, -1.5, -4), (2, 1.5, -4), (-2, 1.5, -4))


def textured(material: Material) -> Instance:
    return Instance(replace(WALL.mesh, material=material))


def look_up(scene: Scene) -> props.Hit:
    return props.cast(scene, AHEAD.position, props.rays(AHEAD, SIZE).directions)


def noise(seed: int, height: int = 4, width: int = 4) -> np.ndarray:
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, 4), np.uint8)
    pixels[..., 3] = 255
    return pixels


def linear(srgb: Any) -> np.ndarray:
    x = np.asarray(srgb, float) / 255
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def texel(pixels: np.ndarray, u: np.ndarray, v: np.ndarray, wrap: str = "repeat") -> np.ndarray:
    """The texel under a texture coordinate, first row at v = 0."""

    def index(x: np.ndarray, count: int) -> np.ndarray:
        i = np.floor(x * count).astype(int)
        if wrap == "repeat":
            return i % count
        if wrap == "mirror":
            return np.where(i // count % 2 == 0, i % count, count - 1 - i % count)
        return np.clip(i, 0, count - 1)

    return pixels[index(v, pixels.shape[0]), index(u, pixels.shape[1])]


def drawn(gpu: Gpu, material: Material, lights: tuple[Any, ...] = (), ambient: float = 1.0) -> np.ndarray:
    # The bias grows with the slope of the shading normal; one that is bent towards the light needs the constant one.
    scene = Scene([textured(material)], lights, AHEAD, ambient=(ambient,) * 3)
    return shoot(gpu, scene, SIZE, shadow=ShadowMap(bias=4.0)).base


@pytest.mark.parametrize(
    ("offset", "rotation", "scale", "wrap"),
    [
        ((0, 0), 0.0, (1, 1), "repeat"),
        ((0.3, -0.2), 0.0, (1, 1), "repeat"),
        ((0.1, 0.2), 0.6, (1.7, 0.8), "repeat"),
        ((0.1, 0.2), -1.1, (-1.3, 2.1), "mirror"),
        ((0.25, 0.1), 0.3, (1.5, 1.5), "clamp"),
    ],
)
def test_texture_coordinates(
    gpu: Gpu, offset: tuple[float, float], rotation: float, scale: tuple[float, float], wrap: Any
) -> None:
    """KHR_texture_transform: uv' = translate · rotate · scale · uv, with its sense of rotation; and wrapping."""
    pixels = noise(1)
    texture = Texture(Image(pixels), wrap, wrap, "nearest", offset, rotation, scale)
    base = drawn(gpu, replace(WHITE, base_color_texture=texture))
    hit = look_up(Scene([WALL]))
    u, v = hit.uv[..., 0] * scale[0], hit.uv[..., 1] * scale[1]
    c, s = math.cos(rotation), math.sin(rotation)
    # The extension's matrix, written out: [c s; −s c].
    u, v = c * u + s * v + offset[0], -s * u + c * v + offset[1]
    expected = linear(texel(pixels, u, v, wrap)[..., :3])
    on = np.isfinite(hit.distance)
    # Pixels whose centre is a hair from a texel's border may go either way.
    clear = on & (np.abs(u * 4 - np.round(u * 4)) > 1e-3) & (np.abs(v * 4 - np.round(v * 4)) > 1e-3)
    assert clear.sum() > 0.95 * on.sum() > 500
    # Mesa's sRGB decoding is an approximation, 2 % off at most in the darkest bytes.
    np.testing.assert_allclose(base[clear], expected[clear], rtol=0.02, atol=1e-4)


def test_colours_are_decoded_and_data_is_not(gpu: Gpu) -> None:
    """Base colour and emission are sRGB, roughness and metallic are linear; factors multiply."""
    grey = np.full((1, 1, 4), (188, 128, 64, 255), np.uint8)
    base = drawn(gpu, replace(WHITE, base_color_texture=Texture(Image(grey)), base_color=(1, 1, 0.5, 1)))
    # The G-buffer keeps albedo in 8 bits: half a step of a dark channel is 2 %.
    np.testing.assert_allclose(base[18, 24], linear([188, 128, 64]) * [1, 1, 0.5], rtol=0.03)
    glow = replace(WHITE, base_color=(0, 0, 0, 1), emissive=(2, 3, 4), emissive_texture=Texture(Image(grey)))
    np.testing.assert_allclose(drawn(gpu, glow, ambient=0)[18, 24], linear([188, 128, 64]) * [2, 3, 4], rtol=0.01)
    # Green 102/255 = 0.4 of roughness 0.5, blue 204/255 = 0.8 of metallic 0.5.
    packed = Texture(Image(np.full((1, 1, 4), (9, 102, 204, 255), np.uint8)))
    by_map = drawn(gpu, replace(WHITE, roughness=0.5, metallic=0.5, metallic_roughness_texture=packed), (SUN,))
    by_factor = drawn(gpu, replace(WHITE, roughness=0.2, metallic=0.4), (SUN,))
    np.testing.assert_allclose(by_map, by_factor, rtol=0.01)


@pytest.mark.parametrize(("mode", "cutoff"), [("mask", 0.5), ("mask", 0.2), ("opaque", 0.5)])
def test_holes(gpu: Gpu, mode: Any, cutoff: float) -> None:
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[..., 3] = np.random.default_rng(2).integers(0, 256, (8, 8))
    material = replace(
        WHITE,
        alpha_mode=mode,
        alpha_cutoff=cutoff,
        base_color=(1, 1, 1, 0.8),
        base_color_texture=Texture(Image(pixels), filter="nearest"),
    )
    shot = shoot(gpu, Scene([textured(material), props.wall(-6)], [], AHEAD, ambient=(1,) * 3), SIZE)
    hit = look_up(Scene([WALL]))
    on = np.isfinite(hit.distance)
    alpha = texel(pixels, hit.uv[..., 0], hit.uv[..., 1])[..., 3] / 255 * 0.8
    hole = on & (alpha < cutoff) & (mode == "mask")
    assert hole.any() == (mode == "mask")
    np.testing.assert_allclose(shot.depth[on], np.where(hole, 6, 4)[on], rtol=1e-4)


@pytest.mark.parametrize("alpha", [0.8, 0.2])
def test_a_mask_without_a_texture_is_there_or_is_not(gpu: Gpu, alpha: float) -> None:
    """For the eye and for the light: behind a mask that is all hole, the wall is lit."""
    material = replace(WHITE, alpha_mode="mask", alpha_cutoff=0.5, base_color=(1, 1, 1, alpha))
    behind = props.wall(-6)
    shot = shoot(gpu, Scene([textured(material), behind], [SUN], AHEAD), SIZE)
    bare = shoot(gpu, Scene([behind] if alpha < 0.5 else [textured(WHITE), behind], [SUN], AHEAD), SIZE)
    np.testing.assert_allclose(shot.depth, bare.depth, rtol=1e-4)
    np.testing.assert_allclose(shot.base, bare.base, atol=1e-3)
    assert bare.base.max() > 0.1


def test_a_flat_normal_map_changes_nothing(gpu: Gpu) -> None:
    """(128, 128, 255) is not quite (0, 0, 1): 1/255 off in both directions."""
    flat = Texture(Image(np.full((2, 2, 4), (128, 128, 255, 255), np.uint8)))
    plain = drawn(gpu, WHITE, (SUN,), ambient=0)
    np.testing.assert_allclose(
        drawn(gpu, replace(WHITE, normal_texture=flat), (SUN,), 0), plain, atol=0.01 * plain.max()
    )


@pytest.mark.parametrize(("bump", "axis"), [((218, 128, 218), 0), ((128, 218, 218), 1)])
@pytest.mark.parametrize("light", [(0.6, 0.0, -0.8), (0.0, 0.6, -0.8), (-0.4, -0.4, -0.8)])
def test_a_normal_map_tilts_the_normal(
    gpu: Gpu, bump: tuple[int, int, int], axis: int, light: tuple[float, float, float]
) -> None:
    """glTF: red is towards +u, green towards the top of the image, which is −v. Here u runs right and v runs up."""
    tilted = Texture(Image(np.full((2, 2, 4), (*bump, 255), np.uint8)))
    lights = (DirectionalLight(light, 2.0),)
    base = drawn(gpu, replace(WHITE, normal_texture=tilted), lights, ambient=0)
    n = np.array(bump) / 255 * 2 - 1
    n[1] = -n[1]
    n /= np.linalg.norm(n)
    assert abs(n[axis]) > 0.6
    scene = Scene([WALL], lights, AHEAD)
    hit = look_up(scene)
    on = np.isfinite(hit.distance)
    expected = props.surface_light(scene, SIZE, n, np.where(on, hit.distance, 1))
    np.testing.assert_allclose(base[on], expected[on], rtol=0.02, atol=0.01)


def rotation(axis: int, angle: float) -> np.ndarray:
    m = np.eye(4)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m[i, i] = m[j, j] = math.cos(angle)
    m[j, i], m[i, j] = math.sin(angle), -math.sin(angle)
    return m


@pytest.mark.parametrize("scale", [(1, 1, 1), (0.5, 1.5, 0.8), (-1, 1, 1), (1, -0.6, 1.4), (-1, -1, -1)])
def test_a_placed_mesh_is_as_if_its_vertices_were_moved(gpu: Gpu, scale: tuple[float, float, float]) -> None:
    """Normals under uneven and mirroring scales, winding and culling: a solid looks the same either way."""
    solid = props.box((-0.6, -0.5, -0.4), (0.5, 0.6, 0.7)).mesh
    matrix = np.eye(4)
    matrix[:3, 3] = (0.2, -0.1, -3)
    matrix = matrix @ rotation(1, 0.6) @ rotation(0, 0.4) @ np.diag([*scale, 1])
    placed = Instance(solid, matrix)
    positions = solid.positions @ matrix[:3, :3].T + matrix[:3, 3]
    turn = np.linalg.det(matrix[:3, :3]) < 0
    indices = solid.indices[:, ::-1] if turn else solid.indices
    moved = Mesh(positions, indices, props.face_normals(positions, indices), material=WHITE)
    images = [shoot(gpu, Scene([i], [SUN], AHEAD), SIZE) for i in (placed, Instance(moved))]
    assert np.isfinite(images[0].depth).sum() > 150
    same = np.abs(images[0].base - images[1].base).max(-1) < 0.01
    assert same.mean() > 0.995
    np.testing.assert_array_equal(np.isfinite(images[0].depth), np.isfinite(images[1].depth))


def test_a_normal_map_on_a_mirrored_mesh(gpu: Gpu) -> None:
    """Seen from its outside, a mirrored wall's u runs the other way, and the bump leans with it."""
    tilted = Texture(Image(np.full((2, 2, 4), (218, 128, 218, 255), np.uint8)))
    mesh = replace(WALL.mesh, material=replace(WHITE, normal_texture=tilted))
    mirror = Instance(mesh, ((-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)))
    base = shoot(gpu, Scene([mirror], [SUN], AHEAD), SIZE, shadow=ShadowMap(bias=4.0)).base
    seen = look_up(Scene([WALL]))
    on = np.isfinite(seen.distance)
    n = np.array([-(218 / 255 * 2 - 1), -(128 / 255 * 2 - 1), 218 / 255 * 2 - 1])
    expected = props.surface_light(
        Scene([WALL], [SUN], AHEAD), SIZE, n / np.linalg.norm(n), np.where(on, seen.distance, 1)
    )
    np.testing.assert_allclose(base[on], expected[on], rtol=0.02, atol=0.01)


def test_instances_of_one_mesh_are_each_in_their_place(gpu: Gpu) -> None:
    cube = props.box((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)).mesh
    places = [(x, y, -4.0) for x in (-1, 0, 1) for y in (-0.6, 0.6)]
    matrices = []
    for place in places:
        m = np.eye(4)
        m[:3, 3] = place
        matrices.append(m)
    one = Scene([Instance(cube, m) for m in matrices], [SUN], AHEAD)
    apart = Scene([props.box(*(tuple(np.add(p, s)) for s in (-0.2, 0.2))) for p in places], [SUN], AHEAD)
    first, second = shoot(gpu, one, SIZE), shoot(gpu, apart, SIZE)
    np.testing.assert_allclose(first.base, second.base, atol=2e-3)
    assert first.memory["mesh"] < second.memory["mesh"]


def test_back_faces_are_seen_where_the_material_says_so(gpu: Gpu) -> None:
    away = props.quad((2, -1.5, -4), (-2, -1.5, -4), (-2, 1.5, -4), (2, 1.5, -4))
    both = Instance(replace(away.mesh, material=replace(WHITE, double_sided=True)))
    hidden = shoot(gpu, Scene([away], [SUN], AHEAD), SIZE)
    assert np.isinf(hidden.depth).all()
    shown = shoot(gpu, Scene([both], [SUN], AHEAD), SIZE)
    front = shoot(gpu, Scene([WALL], [SUN], AHEAD), SIZE)
    np.testing.assert_allclose(shown.base, front.base, atol=2e-3)


def test_mips_average_light_not_bytes(gpu: Gpu) -> None:
    """A black and white checker seen small is half the light, not half the byte (which would be 0.21)."""
    pixels = np.zeros((256, 256, 4), np.uint8)
    pixels[(np.indices((256, 256)).sum(0) % 2).astype(bool)] = 255
    pixels[..., 3] = 255
    base = drawn(gpu, replace(WHITE, base_color_texture=Texture(Image(pixels), scale=(8.0, 8.0))))
    on = np.isfinite(look_up(Scene([WALL])).distance)
    np.testing.assert_allclose(base[on], 0.5, atol=0.02)


def test_bytes_of_a_mesh_are_counted(gpu: Gpu) -> None:
    shot = shoot(gpu, Scene([props.wall(-4), props.box((-1, -1, -3), (1, 1, -2))], [SUN], AHEAD))
    vertices, triangles = 4 + 24, 2 + 12
    geometry = vertices * (12 + 16) + triangles * 12
    dtype_sizes = (
        sum(2 * gpu.dtype(f"package::content::mesh::{s}").itemsize for s in ("InstanceData",))
        + gpu.dtype("package::content::mesh::MaterialData").itemsize
    )
    white_maps = 2 * 4
    assert shot.memory["mesh"] == geometry + dtype_sizes + white_maps


def test_a_flat_instance_is_lit_like_a_flat_mesh(gpu: Gpu) -> None:
    """A box squeezed to no thickness: the normals of its front and back stay, and no matrix needs an inverse."""
    flat = replace(props.box((-2, -1.5, -1), (2, 1.5, 1)), transform=np.diag([1.0, 1.0, 0.0, 1.0]))
    matrix = np.array(flat.transform)
    matrix[2, 3] = -4
    shot = shoot(gpu, Scene([replace(flat, transform=matrix)], [SUN], AHEAD), SIZE, shadow=ShadowMap(bias=4.0)).base
    wall = shoot(gpu, Scene([WALL], [SUN], AHEAD), SIZE, shadow=ShadowMap(bias=4.0)).base
    assert wall.any()
    np.testing.assert_allclose(shot, wall, rtol=2e-3)


def test_normals_of_any_length_give_the_same_light(gpu: Gpu) -> None:
    long = replace(WALL.mesh, normals=np.array([(0, 0, 2.5)] * 4))
    shots = [shoot(gpu, Scene([Instance(mesh)], [SUN], AHEAD), SIZE).base for mesh in (WALL.mesh, long)]
    assert shots[0].any()
    assert np.array_equal(*shots)
    for bad in (0.0, math.nan, math.inf):
        with pytest.raises(ParameterError, match="^normals: a normal is zero or not finite$"):
            replace(WALL.mesh, normals=np.full((4, 3), bad))
