"""Mirrors and glass: images at the exact pixel, Fresnel's numbers, and no light won or lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Implicit, Material, Scene
from tyndall.sdf import box, sphere
from tyndall.sdf.shading import FragmentShader
from tyndall.techniques.reflection.field_reflections import FieldReflections
from tyndall.techniques.reflection.none import NoReflections

SIZE = (64, 48)
MIRROR = Material("mirror", (1, 1, 1, 1), metallic=1.0, roughness=0.1, reflections=True)
GLASS = Material("glass", (1, 1, 1, 1), roughness=0.1, transmission=1.0, ior=1.5)
RED = Material("lamp", (0, 0, 0, 1), roughness=1.0, emissive=(2.0, 0, 0))


def fields(*implicits: Implicit) -> tuple[Implicit, ...]:
    """With specks behind the camera that glow, so that all scenes here share their shaders."""
    return props.fields(*implicits, specks=(0, 0, 60), material=RED)


def draw(gpu: Gpu, scene: Scene, technique: Any = None, size: tuple[int, int] = SIZE, **others: Any) -> np.ndarray:
    chosen: dict[str, Any] = {"volumetric": "off", "antialiasing": "none", "tonemap": "none", **others}
    with Renderer(scene, size, gpu=gpu, reflection=technique or FieldReflections(), **chosen) as renderer:
        renderer.draw()
        return renderer.base().astype(float)


def meets(centre: Any, radius: float, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How far rays pass a ball by, in its radii: below 1 they meet it."""
    way = np.asarray(centre) - origin
    along = (way * directions).sum(-1)
    return np.where(along > 0, np.linalg.norm(way - along[..., None] * directions, axis=-1) / radius, np.inf)


def test_a_mirror_shows_the_ball_where_its_image_is(gpu: Gpu) -> None:
    """A floor that mirrors, and a glowing ball above it: below, the ball's reflection at the exact pixels."""
    floor = Implicit(box((20, 1, 20)).at(0, -0.5, 0), material=MIRROR)
    lamp = Implicit(sphere(0.5).at(0.3, 1.0, -1), material=RED)
    camera = Camera((0, 1.2, 3), (0, 0.3, 0), fov=0.8, near=0.05)
    got = draw(gpu, Scene(camera=camera, background=(0, 0, 0.5), implicits=fields(floor, lamp)))
    rays = props.rays(camera, SIZE)
    direct = meets((0.3, 1.0, -1), 0.5, rays.origin, rays.directions)
    image = meets((0.3, -1.0, -1), 0.5, rays.origin, rays.directions)
    below = (rays.directions[..., 1] < -0.02) & (direct > 1.1)
    assert (below & (image < 0.97)).sum() > 40
    np.testing.assert_allclose(got[below & (image < 0.97)] - (2, 0, 0), 0, atol=5e-3)
    beside = below & (image > 1.03) & (rays.at(-rays.origin[1] / rays.directions[..., 1])[..., 2] > -9)
    np.testing.assert_allclose(got[beside] - (0, 0, 0.5), 0, atol=5e-3)


def through_ball(origin: np.ndarray, directions: np.ndarray, radius: float, ior: float) -> tuple[Any, Any, Any, Any]:
    """(hits, point, direction, Fresnel's reflectance on entry) of rays that were refracted twice by a ball around 0."""
    along = -(directions @ origin)
    miss = np.linalg.norm(origin + along[..., None] * directions, axis=-1)
    hit = miss < radius
    entry = origin + (along - np.sqrt(np.maximum(radius**2 - miss**2, 0)))[..., None] * directions
    n = entry / radius

    def bend(d: np.ndarray, n: np.ndarray, eta: float) -> np.ndarray:
        c = -(d * n).sum(-1, keepdims=True)
        return eta * d + (eta * c - np.sqrt(np.maximum(1 - eta**2 * (1 - c**2), 0))) * n

    inner = bend(directions, n, 1 / ior)
    leave = entry + 2 * -(inner * entry).sum(-1, keepdims=True) * inner
    out = bend(inner, -leave / radius, ior)
    c1 = -(directions * n).sum(-1)
    c2 = np.sqrt(np.maximum(1 - (1 - c1**2) / ior**2, 0))
    rs, rp = (c1 - ior * c2) / (c1 + ior * c2), (ior * c1 - c2) / (ior * c1 + c2)
    return hit, leave, out, 0.5 * (rs**2 + rp**2)


def test_a_glass_ball_shows_the_world_upside_down(gpu: Gpu) -> None:
    """Two refractions in closed form: which rays then meet a lamp behind, and how much of its light is left."""
    camera = Camera((0, 0, 4), (0, 0, 0), fov=0.6, near=0.05)
    lamp_at = (0.6, 0.9, -4.0)
    scene = Scene(
        camera=camera,
        implicits=fields(Implicit(sphere(1.0), material=GLASS), Implicit(sphere(0.9).at(*lamp_at), material=RED)),
    )
    got = draw(gpu, scene, FieldReflections(bounces=6))[..., 0]
    rays = props.rays(camera, SIZE)
    hit, leave, out, fresnel = through_ball(rays.origin, rays.directions, 1.0, 1.5)
    passes = meets(lamp_at, 0.9, leave, out)
    middle = hit & (meets((0, 0, 0), 1.0, rays.origin, rays.directions) < 0.9)
    seen = middle & (passes < 0.95)
    assert seen.sum() > 30
    rows, columns = np.nonzero(seen)
    assert rows.mean() > 24 + 2  # the lamp is above, on the right, and its image below, on the left
    assert columns.mean() < 32 - 2
    # What passes both surfaces; a little comes by three and more reflections inside as well.
    least = 2 * (1 - fresnel[seen]) ** 2
    assert (got[seen] > least - 0.03).all()
    np.testing.assert_allclose(got[seen], least, atol=0.1)
    assert np.median(got[middle & (passes > 1.05)]) < 0.02


def test_fresnel_at_normal_incidence_is_four_hundredths(gpu: Gpu) -> None:
    """Of a dark polished dielectric that faces the camera, and near 1 at grazing angles; a metal mirrors its colour."""
    camera = Camera((0, 0, 5), (0, 0, 0), fov=0.02, near=0.05)
    for material, want in (
        (Material(base_color=(0, 0, 0, 1), ior=1.5, reflections=True), (0.04, 0.04, 0.04)),
        (Material(base_color=(0, 0, 0, 1), ior=2.0, reflections=True), (1 / 9, 1 / 9, 1 / 9)),
        (Material(base_color=(0.9, 0.5, 0.2, 1), metallic=1.0, reflections=True), (0.9, 0.5, 0.2)),
    ):
        slab = Implicit(box((4, 4, 1)).at(0, 0, -0.5), material=material)
        got = draw(gpu, Scene(camera=camera, background=(1, 1, 1), implicits=fields(slab)), size=(8, 8))
        np.testing.assert_allclose(got, np.broadcast_to(want, got.shape), atol=2e-3)


@pytest.mark.parametrize(
    "material",
    [
        MIRROR,
        GLASS,
        replace(GLASS, transmission=0.4, ior=1.3),
        Material(base_color=(1, 1, 1, 1), roughness=0.2, reflections=True),
        Material(base_color=(1, 1, 1, 1), metallic=0.5, roughness=0.2, reflections=True),
    ],
    ids=["mirror", "glass", "milky", "glazed", "half metal"],
)
def test_white_things_in_even_light_vanish(gpu: Gpu, material: Material) -> None:
    """The white furnace: as much light leaves them as arrives."""
    camera = Camera((0, 0.5, 4), (0, 0, 0), fov=0.7, near=0.05)
    things = [
        Implicit(sphere(0.7).at(-0.6, 0, 0), material=material),
        Implicit(box(1).at(0.8, 0, 0), material=material),
    ]
    got = draw(gpu, Scene(camera=camera, background=(1, 1, 1), ambient=(1, 1, 1), implicits=fields(*things)))
    np.testing.assert_allclose(got, 1, atol=4e-3)


def test_a_users_shader_is_told_the_same_of_what_is_polished(gpu: Gpu) -> None:
    """A ball coloured by its normal: 4 % and more mirror what is black, and the rest is as without."""
    shader = FragmentShader(
        "n", "fn shade(properties: FragmentProperties) -> vec3f { return abs(properties.world_normal); }"
    )
    camera = Camera((0, 0, 4), (0, 0, 0), fov=0.3, near=0.05)

    def drawn(reflections: bool) -> np.ndarray:
        material = shader.material(material=Material(reflections=reflections))
        ball = Implicit(sphere(1.0), material=material)
        return draw(gpu, Scene(camera=camera, ambient=(1, 1, 1), implicits=fields(ball)), size=(16, 16))

    np.testing.assert_allclose(drawn(True), 0.96 * drawn(False), atol=0.06)


def test_beers_law_inside(gpu: Gpu) -> None:
    """Straight through a slab: two surfaces, and the colour to the power of its thickness."""
    camera = Camera((0, 0, 5), (0, 0, 0), fov=0.02, near=0.05)
    for thickness in (0.5, 2.0):
        tinted = replace(GLASS, base_color=(0.2, 0.5, 0.9, 1), attenuation_distance=1.0)
        slab = Implicit(box((8, 8, thickness)), material=tinted)
        got = draw(
            gpu,
            Scene(camera=camera, background=(1, 1, 1), implicits=fields(slab)),
            FieldReflections(bounces=8),
            (8, 8),
        )
        # Both mirrored parts bring the background too; inside, the light goes to and fro.
        f, a = 0.04, np.array((0.2, 0.5, 0.9)) ** thickness
        want = f + (1 - f) ** 2 * a / (1 - f**2 * a**2) + (1 - f) ** 2 * f * a**2 / (1 - f**2 * a**2)
        np.testing.assert_allclose(got, np.broadcast_to(want, got.shape), atol=4e-3)


def test_beyond_the_angle_of_total_reflection_nothing_gets_out(gpu: Gpu) -> None:
    """Through a block's side, its lower face mirrors all that comes from the far side."""
    camera = Camera((0, 2.0, 4.0), (0, 0, 0), fov=0.05, near=0.05)
    block = Implicit(box((6, 2, 2)), material=replace(GLASS, ior=1.8))
    below = Implicit(box((30, 0.2, 30)).at(0, -2.0, 0), material=RED)
    got = draw(
        gpu,
        Scene(camera=camera, background=(0, 0, 1), implicits=fields(block, below)),
        FieldReflections(bounces=8),
    )
    # The ray enters at 1.8·sin(b) = sin(a); it comes to the lower face so flatly that it cannot leave there.
    assert got.shape == (*SIZE[::-1], 3)
    assert np.isfinite(got).all()


def test_what_is_mirrored_is_lit_and_shaded(gpu: Gpu) -> None:
    """By the scene's lights through its shadow technique: the mirror image of a lit box is as bright as the box."""
    floor = Implicit(box((20, 1, 20)).at(0, -0.5, 0), material=MIRROR)
    white = Material(base_color=(0.8, 0.8, 0.8, 1), roughness=1.0)
    thing = Implicit(box((1, 1, 1)).at(0, 1.0, 0), material=white)
    light = DirectionalLight((0, 0, -1), 2.0)
    camera = Camera((0, 0.4, 4), (0, 0.4, 0), fov=0.7, near=0.05)
    got = draw(gpu, Scene([], [light], camera, implicits=fields(floor, thing)), shadow="field")
    rays = props.rays(camera, SIZE)
    face = rays.at((0.5 - 4) / rays.directions[..., 2])
    direct = (np.abs(face[..., 0]) < 0.4) & (np.abs(face[..., 1] - 1) < 0.4)
    mirrored = (np.abs(face[..., 0]) < 0.4) & (np.abs(face[..., 1] + 1) < 0.4)
    assert direct.sum() > 20
    assert mirrored.sum() > 20
    assert got[mirrored].mean() == pytest.approx(got[direct].mean(), rel=0.03)


def test_matte_things_are_left_alone(gpu: Gpu) -> None:
    light = DirectionalLight((0.3, -1, -0.2), 2.0)
    camera = Camera((0, 0.5, 4), (0, 0, 0), fov=0.7, near=0.05)
    matte = Scene([], [light], camera, implicits=fields(Implicit(sphere(1.0), material=props.WHITE)))
    assert np.array_equal(draw(gpu, matte), draw(gpu, matte, NoReflections()))
    ball = Implicit(sphere(0.3).at(1.4, 0, 0), material=MIRROR)
    both = matte.with_(implicits=fields(matte.implicits[-1], ball))
    off = draw(gpu, both, NoReflections())
    on = draw(gpu, both)
    inside = meets((0, 0, 0), 1.0, np.array(camera.position), props.rays(camera, SIZE).directions) < 0.9
    assert np.array_equal(on[inside], off[inside])
    assert not np.array_equal(on, off)
