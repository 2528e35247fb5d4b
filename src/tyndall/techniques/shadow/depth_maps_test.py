"""What holds for every technique that stands on depth maps, and finer maps near the camera."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import props
import pytest

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Light, Medium, PointLight, Scene, SpotLight, box_corners
from tyndall.techniques.shadow.depth_maps import DepthMaps, cuts, finer_layers, light_layers, slice_spheres
from tyndall.techniques.shadow.esm import Esm
from tyndall.techniques.shadow.evsm import Evsm
from tyndall.techniques.shadow.pcf import Pcf
from tyndall.techniques.shadow.pcss import Pcss
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.shadow.vsm import Vsm
from tyndall.techniques.volumetric.march import March

SIZE = (64, 48)
ALL: list[type[DepthMaps]] = [ShadowMap, Pcf, Pcss, Vsm, Esm, Evsm]
SUN = DirectionalLight((0.5, -1.0, -0.35), 3.0)
ABOVE = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
CUBE = props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5))

# A lane of posts, seen along it.
LANE = Scene(
    [
        props.floor(0, 40),
        *(props.box((x, 0, z), (x + 0.3, 1, z + 0.3)) for x in (-1.0, 0.7) for z in np.arange(-30.0, 2.0, 2.0)),
    ],
    [DirectionalLight((0.6, -1.0, 0.3), 3.0)],
    Camera((0, 1.5, 5), (0, 0.3, -3), fov=0.8, near=0.05),
)


# --- every technique ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cls", ALL)
@pytest.mark.parametrize("cascades", [0, 2])
@pytest.mark.parametrize(
    "light",
    [
        pytest.param(replace(SUN, angular_diameter=0.1), id="directional"),
        pytest.param(PointLight((0.5, 3.0, 0.4), 20.0, radius=0.1), id="point"),
        pytest.param(SpotLight((0, 5, 0), (0.2, -1, 0.1), 40.0, (1, 1, 1), 0.9, 1.2, radius=0.1), id="spot"),
    ],
)
def test_a_plane_in_full_light_loses_nothing(gpu: Gpu, cls: type[DepthMaps], cascades: int, light: Light) -> None:
    if cascades and not isinstance(light, DirectionalLight):
        pytest.skip("only directional lights have finer maps")
    scene = Scene([props.floor(0, 4)], [light], ABOVE)
    assert props.shade(gpu, scene, cls(size=256, cascades=cascades), SIZE).min() == 1


@pytest.mark.parametrize(
    "technique",
    [
        Pcf(size=256, radius=0, samples=1),
        Pcf(size=256, radius=0, samples=64),
        Pcf(size=256, radius=1e-4),
        Pcss(size=256, min_radius=0),
        Vsm(size=256, radius=0, bleeding=0.5),
        Esm(size=256, radius=0, exponent=16),
        Evsm(size=256, radius=0, bleeding=0.5),
    ],
    ids=lambda t: f"{t.name}",
)
@pytest.mark.parametrize("light", [SUN, PointLight((-1.2, 2.2, 0.9), 20.0)], ids=["directional", "point"])
def test_without_a_radius_all_are_the_shadow_map(gpu: Gpu, technique: DepthMaps, light: Light) -> None:
    scene = Scene([props.floor(0, 4), CUBE], [light], ABOVE)
    soft = props.shade(gpu, scene, technique, SIZE)
    hard = props.shade(gpu, scene, ShadowMap(size=256), SIZE)
    if isinstance(technique, (Pcf, Pcss)):
        np.testing.assert_allclose(soft, hard, atol=2e-3)
        return
    # Moments are interpolated before the comparison, which moves an edge within its texel.
    whole = np.minimum(hard, 1 - hard) < 0.01
    assert whole.mean() > 0.9
    assert np.abs(soft - hard)[whole].mean() < 0.01
    assert (np.abs(soft - hard)[whole] < 0.1).mean() > 0.98


@pytest.mark.parametrize("cls", [Pcf, Vsm, Esm, Evsm])
def test_a_wider_radius_makes_wider_edges(gpu: Gpu, cls: type[DepthMaps]) -> None:
    scene = Scene([props.floor(0, 4), CUBE], [DirectionalLight((0, -1, 0), 3.0)], ABOVE)
    between = []
    for radius in (0.5, 4.0, 12.0):
        seen = props.shade(gpu, scene, cls(size=256, radius=radius), SIZE, frames=2)  # type: ignore[call-arg]
        between.append(((seen > 0.05) & (seen < 0.95)).sum())
    assert between[1] > 1.5 * between[0]
    assert between[2] > 1.5 * between[1]


@pytest.mark.parametrize(
    "technique",
    [Vsm(size=128, radius=12), Esm(size=128, radius=12, exponent=0.05), Evsm(size=128, radius=12)],
    ids=lambda t: f"{t.name}",
)
def test_a_wide_blur_shows_no_seam_of_the_cube(gpu: Gpu, technique: DepthMaps) -> None:
    """Down the middle of a face's edge, where the light at 45° meets the floor, visibility does not jump."""
    light = PointLight((0, 2, 0), 20.0)
    bar = props.box((0.6, 0.9, -0.2), (1.2, 1.0, 1.6))  # stands over the edge between +X and −Y
    camera = Camera((2.0, 5, 0.7), (2.0, 0, 0.69), fov=0.9, near=0.05)
    scene = Scene([props.floor(0, 4), bar], [light], camera)
    seen = props.shade(gpu, scene, technique, (96, 72))
    assert seen.min() < 0.5
    floor = props.cast(scene, camera.position, props.rays(camera, (96, 72)).directions).instance == 0
    both = floor[:, 1:] & floor[:, :-1]
    assert np.abs(np.diff(seen, axis=1))[both].max() < 0.3
    hard = props.shade(gpu, scene, ShadowMap(size=128), (96, 72))
    assert np.abs(np.diff(hard, axis=1))[both].max() > 0.5, "without the blur it would"


# --- finer maps ---------------------------------------------------------------------------------------------------


def test_a_slices_sphere_holds_its_corners_tightly() -> None:
    for fov, aspect in ((0.5, 1.0), (0.9, 16 / 9), (2.2, 1.0)):
        camera = Camera((1, 2, 3), (0, 0.5, -1), fov=fov)
        ends = cuts(50.0, 3, 0.7)
        assert ends == sorted(ends)
        assert ends[0] > 0
        assert ends[-1] < 50
        tangent = math.tan(fov / 2)
        seen = props.rays(camera, (2, 2))
        forward = seen.directions.mean(axis=(0, 1))
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, camera.up)
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        spheres = slice_spheres(camera, aspect, ends)
        for begin, end, (centre, radius) in zip([0.0, *ends[:-1]], ends, spheres, strict=True):
            corners = [
                camera.position + depth * (forward + tangent * (x * aspect * right + y * up))
                for depth in (begin, end)
                for x in (-1, 1)
                for y in (-1, 1)
            ]
            away = np.linalg.norm(np.array(corners) - centre, axis=1)
            assert away.max() == pytest.approx(radius, rel=1e-9)


def test_texels_stay_where_they_are_while_the_camera_moves() -> None:
    """A fixed point keeps its place within a texel, and texels their width, so that edges do not crawl."""
    rng = np.random.default_rng(4)
    point = np.array([0.3, 0.7, -1.1, 1.0])
    size, places, widths = 256, [], []
    for _ in range(20):
        position = rng.normal(size=3) * 3
        camera = Camera(tuple(position), tuple(position + rng.normal(size=3)), fov=0.8)
        layers = finer_layers(LANE, camera, 1.5, size, 2, 3, 0.7)
        places.append([(layer.matrix @ point)[:2] * size / 2 for layer in layers])
        widths.append([layer.texel for layer in layers])
    phase = np.exp(2j * np.pi * np.array(places))  # a texel is one turn
    np.testing.assert_allclose(phase, np.broadcast_to(phase[0], phase.shape), atol=1e-6)
    np.testing.assert_allclose(widths, np.broadcast_to(widths[0], np.shape(widths)), rtol=1e-12)
    assert np.std(places) > 1, "the maps must have moved"


def test_finer_maps_are_finer_and_as_deep_as_the_scene() -> None:
    (base,) = light_layers(LANE, 256)
    layers = finer_layers(LANE, LANE.camera, 1.5, 256, 2, 4, 0.7)
    widths = [layer.texel for layer in (*layers, base)]
    assert widths == sorted(widths)
    assert widths[0] < 0.2 * widths[-1]
    corners = np.c_[box_corners(*LANE.bounds), np.ones(8)]
    for layer in layers:
        depth = (layer.matrix @ corners.T)[2]
        assert depth.min() > 0
        assert depth.max() < 1
        np.testing.assert_allclose(layer.matrix[2], base.matrix[2], rtol=1e-12)


def test_finer_maps_sharpen_what_is_near(gpu: Gpu) -> None:
    size = (96, 72)
    seen = props.rays(LANE.camera, size)
    hit = props.cast(LANE, seen.origin, seen.directions)
    floor = hit.instance == 0
    truth = props.lit(LANE, LANE.lights[0], seen.at(np.where(floor, hit.distance, 1)))
    assert (~truth & floor).sum() > 50
    wrong = [
        np.abs(props.shade(gpu, LANE, ShadowMap(size=256, cascades=cascades), size) - truth)[floor].mean()
        for cascades in (0, 2, 4)
    ]
    assert wrong[1] < 0.6 * wrong[0]
    assert wrong[2] < 0.8 * wrong[1]


@pytest.mark.parametrize("cls", ALL)
def test_maps_take_over_from_each_other_without_a_line(gpu: Gpu, cls: type[DepthMaps]) -> None:
    """A shadow that runs through all maps is dark throughout, and nothing beside it is."""
    beam = props.box((-1.5, 1.2, -38), (1.5, 1.3, 38))
    camera = Camera((8, 2.5, 8), (0, 0, -6), fov=0.8, near=0.05)
    scene = Scene([props.floor(0, 40), beam], [DirectionalLight((0.1, -1, 0.05), 3.0)], camera)
    size = (48, 64)
    seen = props.rays(scene.camera, size)
    hit = props.cast(scene, seen.origin, seen.directions)
    points = seen.at(np.where(hit.instance == 0, hit.distance, 1))
    shade = props.shade(gpu, scene, cls(size=512, cascades=3), size)
    shift = 0.1 * 1.25
    inside = (hit.instance == 0) & (np.abs(points[..., 0] - shift) < 0.6) & (np.abs(points[..., 2]) < 36)
    outside = (hit.instance == 0) & (np.abs(points[..., 0] - shift) > 2.5)
    assert np.ptp(points[inside][:, 2]) > 10
    assert shade[inside].max() < 0.03
    assert shade[outside].min() > 0.97


def test_the_frames_own_camera_places_them(gpu: Gpu) -> None:
    there = Camera((3, 1.0, -14), (0, 0.3, -20), fov=0.8, near=0.05)
    technique = ShadowMap(size=128, cascades=3)
    with Renderer(LANE, SIZE, gpu=gpu, volumetric="off", antialiasing="none", shadow=technique) as renderer:
        renderer.draw()
        renderer.draw(there)
        moved = renderer.base()
    with Renderer(replace(LANE, camera=there), SIZE, gpu=gpu, volumetric="off", antialiasing="none") as renderer:
        renderer.use("shadow", technique)
        renderer.draw()
        np.testing.assert_array_equal(moved, renderer.base())


def test_the_air_is_shaded_everywhere(gpu: Gpu) -> None:
    """Finer maps sharpen shafts where they are; behind the camera, and beside what it sees, the scene's own is read."""
    medium = Medium(0.05, 0.01, bounds=((-6, -6, -8), (6, 6, 3)))
    camera = Camera((0.4, 0.3, 1.5), (0, 0, -4), fov=0.9, near=0.05)
    shapes = [*props.slits(-3, 3, 0.5, 3), props.floor(-1.5, 9)]
    scene = Scene(shapes, [DirectionalLight((0.3, -0.1, 1.0), 5.0)], camera, medium)
    march = March(steps=64, jitter=0)
    rays, plain, finer = (
        props.shoot(gpu, scene, (24, 18), volumetric=march, shadow=shadow).inscattered
        for shadow in (RayTraced(), ShadowMap(size=1024), ShadowMap(size=1024, cascades=3))
    )
    assert props.difference(finer, rays) < 0.5 * props.difference(plain, rays)
    walked = [
        props.shoot(
            gpu, scene, (24, 18), volumetric="polygonal", shadow=ShadowMap(size=256, cascades=count)
        ).inscattered
        for count in (0, 3)
    ]
    np.testing.assert_array_equal(walked[0], walked[1], err_msg="what walks the maps walks the scene's own")


# --- drawn by compute passes --------------------------------------------------------------------------------------


@pytest.mark.parametrize("cls", ALL)
@pytest.mark.parametrize(
    "light",
    [
        pytest.param(replace(SUN, angular_diameter=0.05), id="directional"),
        pytest.param(PointLight((-1.2, 2.2, 0.9), 20.0, radius=0.1), id="point"),
    ],
)
def test_maps_are_the_same_whatever_draws_them(gpu: Gpu, cls: type[DepthMaps], light: Light) -> None:
    """Finer maps, filters and blurs included."""
    scene = Scene([props.floor(0, 4), CUBE], [light], ABOVE)
    shades = []
    for rasterizer in ("hardware", "compute"):
        technique = cls(size=128, cascades=1, rasterizer=rasterizer)
        with Renderer(scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none", shadow=technique) as renderer:
            renderer.draw()
            shades.append(renderer.base()[..., 0])
    assert shades[0].std() > 0.1 * shades[0].mean()
    close = np.abs(shades[0] - shades[1]) < 0.01 * shades[0].max()
    assert close.mean() > 0.998


def test_what_compute_passes_cannot_draw_the_hardware_does(gpu: Gpu) -> None:
    """Maps that a volumetric technique walks through, and surfaces with holes; nothing is left of those before."""
    technique = ShadowMap(size=64, rasterizer="compute")
    air = Medium(0.05, bounds=((-2, 0, -2), (2, 2, 2)))
    holes = replace(CUBE.mesh.material, alpha_mode="mask")
    solid = Scene([props.floor(0, 4), CUBE], [SUN], ABOVE, air)
    masked = solid.with_(instances=(props.floor(0, 4), props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5), holes)))
    for scene in (solid, masked):
        with Renderer(scene, SIZE, gpu=gpu, volumetric="polygonal", antialiasing="none", shadow=technique) as renderer:
            found = []
            for volumetric in ("polygonal", "off", "polygonal"):
                renderer.use("volumetric", volumetric)
                renderer.draw()
                found.append(renderer.base())
                held = {label for owner, label, _ in gpu.ledger if owner == "shadow.shadow_map" and "maps" in label}
                assert len(held) == 1
            assert found[0].std() > 0
            np.testing.assert_allclose(found[1], found[0], atol=0.02 * found[0].max())
            assert (found[2] == found[0]).all()
