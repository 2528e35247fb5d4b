"""Which planes a scene has, and what must hold for every technique that draws shadows on them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest
from props import WHITE, shoot

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Image,
    Instance,
    Light,
    Mesh,
    PointLight,
    RectLight,
    Scene,
    SpotLight,
    Texture,
)
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import Unsupported
from tyndall.techniques.shadow.planes import flatness, planes_of

SERVING = [name for name, cls in FAMILIES["shadow"].members.items() if cls.receivers == "planes"]
SIZE = (96, 72)
ABOVE = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
SUN = DirectionalLight((0.5, -1.0, -0.35), 3.0)
LAMP = PointLight((-1.2, 2.2, 0.9), 20.0)
SPOT = SpotLight((-1.5, 3.0, 0.5), (0.5, -1, -0.15), 40.0, (1, 1, 1), 0.5, 0.7)
PANEL = RectLight((-1.2, 2.2, 0.9), (0.5, -1, -0.3), 20.0, width=0.01, height=0.02)
CUBE = props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5))
BOTH_SIDES = replace(WHITE, double_sided=True)


def scaled(factor: float, instance: Instance) -> Instance:
    matrix = np.diag([factor, factor, factor, 1.0]) @ np.asarray(instance.transform)
    return replace(instance, transform=tuple(tuple(float(x) for x in row) for row in matrix))


def ball(radius: float = 1.0) -> Instance:
    """A sphere of 2 · 24 · 12 triangles."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    positions = radius * np.stack([np.sin(v) * np.cos(u), np.cos(v), np.sin(v) * np.sin(u)], -1).reshape(-1, 3)
    i = np.arange(12 * 25).reshape(12, 25)[:, :-1].ravel()
    return Instance(
        Mesh(positions, np.concatenate([np.stack(c, 1) for c in ((i, i + 1, i + 26), (i, i + 26, i + 25))]))
    )


# --- finding them -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("away", [0.0, 50.0])
def test_a_floor_of_many_pieces_is_one_plane(scale: float, away: float) -> None:
    """Of boards and tiles, turned and far from the origin: their areas add up, and all of their corners lie in it."""
    turn = props.turned(0.35, 0.4)
    move = np.eye(4)
    move[:3, 3] = away
    pieces = [props.boards(40, 1, 8), *(props.floor(0, 1) for _ in range(3)), props.box((0, -3, 0), (1, -1, 1))]
    for number in (1, 2, 3):
        pieces[number] = replace(
            pieces[number], transform=((1, 0, 0, 5 + 2 * number), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
        )
    placed = [
        scaled(scale, replace(p, transform=move @ np.asarray(turn.place(p).transform) @ np.asarray(p.transform)))
        for p in pieces
    ]
    scene = Scene(placed, [DirectionalLight(turn.point(0, -1, 0), 1.0)], ABOVE)
    planes = planes_of(scene, 16, 0.02)
    assert len(planes) == 1, "the box's top has less, and its other sides turn away from the light"
    (plane,) = planes
    assert plane.share == pytest.approx((40 * 8 + 3 * 4) / (40 * 8 + 3 * 4 + 1), rel=1e-4)
    np.testing.assert_allclose(np.abs(plane.normal @ turn.matrix[:, 1]), 1, rtol=1e-6)
    for instance in placed[:4]:
        matrix = np.asarray(instance.transform)
        corners = instance.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        assert np.abs(corners @ plane.normal + plane.offset).max() < flatness(scene)
    assert flatness(scene) < 2e-3 * scale


def test_only_what_a_light_can_shine_on_counts() -> None:
    room = props.box((-3, 0, -3), (3, 4, 3))
    inside = PointLight((0, 2, 0), 1.0)
    assert not planes_of(Scene([room], [inside], ABOVE), 16, 0.01), "a box is seen from outside"
    both = Instance(replace(room.mesh, material=BOTH_SIDES))
    assert len(planes_of(Scene([both], [inside], ABOVE), 16, 0.01)) == 6
    outside = planes_of(Scene([room], [PointLight((0, 9, 0), 1.0)], ABOVE), 16, 0.01)
    assert [abs(plane.normal[1]) for plane in outside] == pytest.approx([1])
    mirror = replace(room, transform=((-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)))
    assert not planes_of(Scene([mirror], [inside], ABOVE), 16, 0.01), "mirroring turns nothing inside out"
    assert len(planes_of(Scene([room], [SUN], ABOVE), 16, 0.01)) == 3
    assert len(planes_of(Scene([room], [SUN], ABOVE), 2, 0.01)) == 2


def test_what_the_camera_faces_comes_first() -> None:
    """A small floor before it counts for more than the large back of a wall."""
    back = props.quad((9, 0, -3), (-9, 0, -3), (-9, 9, -3), (9, 9, -3))  # faces −z
    scene = Scene([back, props.floor(0, 2)], [DirectionalLight((0.1, -1, 1), 1.0)], ABOVE)
    first, second = planes_of(scene, 16, 0.01)
    assert abs(first.normal[1]) == pytest.approx(1)
    assert first.share < second.share
    assert first.seen == first.share
    assert second.seen == 0


@pytest.mark.parametrize("name", SERVING)
def test_a_scene_without_planes_is_refused(gpu: Gpu, name: str) -> None:
    technique = FAMILIES["shadow"].make(name)
    scene = Scene([ball()], [SUN], ABOVE)
    with pytest.raises(Unsupported, match=f"^{name}: shadows fall on planes only, and no plane that .* has 2 %.*map"):
        technique.supports(scene)
    with Renderer(scene, props.TINY, gpu=gpu, volumetric="off", shadow="shadow_map") as renderer:
        with pytest.raises(Unsupported):
            renderer.use("shadow", name)
        assert renderer.technique("shadow").name == "shadow_map"
    below = props.quad((-9, -1, -9), (9, -1, -9), (9, -1, 9), (-9, -1, 9))  # faces down
    with pytest.raises(Unsupported, match="camera faces"):
        technique.supports(Scene([ball(), below], [PointLight((0, -3, 0))], ABOVE))
    technique.supports(Scene([ball(), props.floor(-1)], [SUN], ABOVE))
    technique.supports(Scene([ball()], [], ABOVE))


# --- shadows on them ----------------------------------------------------------------------------------------------


def agreement(
    gpu: Gpu, name: str, scene: Scene, *, of: Any = 0, size: tuple[int, int] = SIZE, **changes: Any
) -> tuple[float, np.ndarray]:
    """Share of some instances' pixels, where the light does not graze, that are lit as rays say; what rays say."""
    (light,) = scene.lights
    seen = props.rays(scene.camera, size)
    hit = props.cast(scene, seen.origin, seen.directions)
    points = seen.at(np.where(np.isfinite(hit.distance), hit.distance, 1))
    _, travels = props.arriving(light, 0.0, points)
    technique = FAMILIES["shadow"].make(name, changes=changes)
    with Renderer(scene, size, gpu=gpu, volumetric="off", antialiasing="none", shadow=technique) as renderer:
        renderer.draw()
        base = renderer.base()[..., 0].astype(float)
        renderer.draw(casters=False)
        full = renderer.base()[..., 0].astype(float)
    on = np.isin(hit.instance, np.atleast_1d(of)) & (-(travels * hit.normal).sum(-1) > 0.03) & (full > 0)
    assert on.sum() > 300
    # Not at an outline, where the rasteriser may show another surface than the ray.
    on &= np.all([np.roll(hit.instance, s, a) == hit.instance for a in (0, 1) for s in (-1, 1)], axis=0)
    truth = props.lit(scene, light, points)
    return float(((base > 0.5 * full) == truth)[on].mean()), truth[on]


@pytest.mark.parametrize("name", SERVING)
@pytest.mark.parametrize("light", [SUN, LAMP, SPOT, PANEL], ids=lambda light: light.kind)
@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e2])
def test_a_floor_and_a_wall_as_rays_see_them(gpu: Gpu, name: str, light: Light, scale: float) -> None:
    """The caster stands through the floor, and the wall itself casts a shadow on the floor behind it."""
    wall = props.quad((-4, 0, -1.5), (4, 0, -1.5), (4, 2.5, -1.5), (-4, 2.5, -1.5), BOTH_SIDES)
    shapes = [props.floor(0, 4), wall, CUBE, props.box((-2, -0.5, -1.4), (-1.6, 2.6, -0.8))]
    camera = Camera(*(tuple(scale * x for x in p) for p in (ABOVE.position, ABOVE.target)), fov=0.8, near=0.05 * scale)
    if not isinstance(light, DirectionalLight):
        light = replace(
            light, position=tuple(scale * x for x in light.position), intensity=scale * scale * light.intensity
        )
        if isinstance(light, RectLight):
            light = replace(light, width=scale * light.width, height=scale * light.height)
    scene = Scene([scaled(scale, s) for s in shapes], [light], camera)
    share, truth = agreement(gpu, name, scene, of=(0, 1))
    assert 0.02 < (~truth).mean() < 0.98
    assert share >= (0.999 if name == "planar" else 0.985)


CASES = {
    "caster beyond the light": (LAMP, [props.box((-2, 2.6, 0), (-0.4, 3, 1.6))], 0.0),
    "caster below the floor": (SUN, [props.box((-1, -2, -1), (1, -0.5, 1))], 0.0),
    "caster below the floor, lamp": (LAMP, [props.box((-1, -2, -1), (1, -0.5, 1))], 0.0),
    "caster through the floor": (SUN, [props.box((-1, -1, -1), (1, 1, 1))], 0.02),
    "caster beside the lamp, from the floor to above it": (LAMP, [props.box((-0.6, 0, 0), (-0.3, 5, 1.5))], 0.05),
    "triangle through the floor and above the lamp": (
        LAMP,
        [props.quad((-0.5, -3, 0), (-0.5, -3, 1.5), (-0.5, 6, 1.0), (-0.5, 6, 0.5), BOTH_SIDES)],
        0.02,
    ),
    "caster behind a spot light": (SPOT, [props.box((-2.5, 3.4, 0), (-1.2, 3.8, 1))], 0.0),
}


@pytest.mark.parametrize("name", SERVING)
@pytest.mark.parametrize("case", CASES)
def test_there_are_no_anti_shadows(gpu: Gpu, name: str, case: str) -> None:
    """What is behind the receiver or beyond the light casts nothing, also where a triangle is so in part."""
    light, casters, least = CASES[case]
    share, truth = agreement(gpu, name, Scene([props.floor(0, 4), *casters], [light], ABOVE))
    assert (~truth).mean() >= least
    if not least:
        assert truth.all()
    assert share >= (1.0 if truth.all() else 0.998 if name == "planar" else 0.985)


@pytest.mark.parametrize("name", SERVING)
def test_light_from_below_a_floor(gpu: Gpu, name: str) -> None:
    """Of a floor that is lit from below, the underside has the shadows of what is there, the upper side is dark."""
    floor = props.floor(0, 4, BOTH_SIDES)
    lamp = PointLight((0.4, -2.5, 0.3), 20.0)
    shapes = [floor, props.box((-0.5, -1.2, -0.5), (0.5, -0.6, 0.5)), CUBE]
    below = Camera((2.5, -4, 4.5), (0, -0.3, 0), fov=0.8, near=0.05)
    share, truth = agreement(gpu, name, Scene(shapes, [lamp], below))
    assert (~truth).mean() > 0.02
    assert share >= (0.998 if name == "planar" else 0.985)
    above = shoot(gpu, Scene(shapes, [lamp], ABOVE), SIZE, shadow=name)
    seen = props.rays(ABOVE, SIZE)
    on = props.cast(Scene(shapes), seen.origin, seen.directions).instance == 0
    assert np.percentile(above.base[on], 95) == 0


@pytest.mark.parametrize("name", SERVING)
def test_a_mirrored_caster_has_the_shadow_of_its_mirror_image(gpu: Gpu, name: str) -> None:
    wedge = Mesh(
        np.array([(-1, 0.3, -0.4), (0.2, 0.3, -0.4), (0.8, 1.2, 0.6)]), np.array([(0, 1, 2)]), material=BOTH_SIDES
    )
    mirror = ((-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
    moved = replace(wedge, positions=wedge.positions * (-1, 1, 1), indices=wedge.indices[:, ::-1], normals=None)
    drawn = [
        shoot(gpu, Scene([props.floor(0, 4), caster], [LAMP], ABOVE), SIZE, shadow=name).base
        for caster in (Instance(wedge, mirror), Instance(moved), Instance(wedge))
    ]
    np.testing.assert_allclose(drawn[0], drawn[1], atol=1e-3)
    assert (np.abs(drawn[0] - drawn[2]).max(-1) > 0.1).sum() > 50


@pytest.mark.parametrize("name", SERVING)
@pytest.mark.parametrize("light", [LAMP, SPOT], ids=lambda light: light.kind)
def test_holes_of_a_masked_caster_are_projected_too(gpu: Gpu, name: str, light: Light) -> None:
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[0, 0, 3] = pixels[1, 1, 3] = 0
    mask = replace(BOTH_SIDES, alpha_mode="mask", base_color_texture=Texture(Image(pixels), filter="nearest"))
    tilted = props.quad((-0.6, 0.3, 0.6), (0.6, 0.3, 0.6), (0.6, 1.2, -0.6), (-0.6, 1.2, -0.6), mask)
    share, truth = agreement(gpu, name, Scene([props.floor(0, 4), tilted], [light], ABOVE))
    assert 0.02 < (~truth).mean() < 0.98
    assert share >= 0.985


@pytest.mark.parametrize("name", SERVING)
def test_a_bumpy_floor_is_a_plane_still(gpu: Gpu, name: str) -> None:
    bumps = np.full((4, 4, 4), (128, 128, 255, 255), np.uint8)
    bumps[::2, ::2, 0] = 190
    floor = props.floor(0, 4, replace(WHITE, normal_texture=Texture(Image(bumps), scale=(8.0, 8.0))))
    share, truth = agreement(gpu, name, Scene([floor, CUBE], [SUN], ABOVE))
    assert (~truth).mean() > 0.02
    assert share >= 0.985


@pytest.mark.parametrize("name", SERVING)
def test_what_is_not_served_is_lit(gpu: Gpu, name: str) -> None:
    """A shelf too small to be a receiver has no shadow where the floor beside it has."""
    shelf = props.box((-0.4, 0.1, 0.2), (0.6, 0.2, 0.9))
    roof = props.box((-2, 2, -2), (2, 2.2, 2))
    scene = Scene(
        [props.floor(0, 4), shelf, roof], [DirectionalLight((0, -1, 0), 3.0)], replace(ABOVE, position=(1, 1.5, 4.5))
    )
    hit = props.cast(scene, props.rays(scene.camera, SIZE).origin, props.rays(scene.camera, SIZE).directions)
    top = (hit.instance == 1) & (hit.normal[..., 1] > 0.9)
    base = shoot(gpu, scene, SIZE, shadow=FAMILIES["shadow"].make(name, changes={"share": 0.2})).base[..., 0]
    assert top.sum() > 20
    assert np.median(base[top]) == pytest.approx(3 / math.pi, rel=0.1)
    small = shoot(gpu, scene, SIZE, shadow=FAMILIES["shadow"].make(name, changes={"share": 0.005})).base[..., 0]
    assert np.median(small[top]) == 0


@pytest.mark.parametrize("name", SERVING)
def test_lights_are_each_in_their_own_channel(gpu: Gpu, name: str) -> None:
    """The light of nine lights is the sum of what each gives alone."""
    angles = np.arange(9) * 0.7
    lights: list[Light] = [DirectionalLight((0.6 * math.cos(a), -1, 0.6 * math.sin(a)), 0.4) for a in angles[:6]]
    lights += [PointLight((2 * math.cos(a), 2.5, 2 * math.sin(a)), 2.0) for a in angles[6:]]
    shapes = [props.floor(0, 4), CUBE]
    together = shoot(gpu, Scene(shapes, lights, ABOVE), (48, 36), shadow=name).base
    alone = sum(shoot(gpu, Scene(shapes, [light], ABOVE), (48, 36), shadow=name).base for light in lights)
    # Each has its own map of the scene, but the fit of the maps to it is the same; half floats round.
    np.testing.assert_allclose(together, alone, atol=4e-3)


@pytest.mark.parametrize("name", SERVING)
@pytest.mark.parametrize(
    "light",
    [
        pytest.param(PointLight((0.2, 0.0, 0.3), 5.0), id="in the floor"),
        pytest.param(PointLight((0.0, 1.4, 0.0), 5.0), id="on the caster"),
        pytest.param(PointLight((0.0, 0.9, 0.0), 5.0), id="inside the caster"),
        pytest.param(PointLight((1e4, 2e4, 1e4), 1e9), id="far outside"),
        pytest.param(DirectionalLight((1, 0, 0), 3.0), id="along the floor"),
    ],
)
def test_lights_at_odd_places_give_finite_light(gpu: Gpu, name: str, light: Light) -> None:
    scene = Scene([props.floor(0, 4, BOTH_SIDES), CUBE], [light], ABOVE, ambient=(0.1, 0.1, 0.1))
    base = shoot(gpu, scene, (48, 36), shadow=name).base
    assert np.isfinite(base).all()
    assert base[-1].min() > 0.05
