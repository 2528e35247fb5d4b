"""The blur of a shadow map's image: its kernel, what it leaves alone, and where it stops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import props
import pytest
from props import AHEAD, WHITE

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import DirectionalLight, Light, PointLight, Scene, SpotLight
from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow.blurred import Blurred
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.volumetric.march import March

SIZE = (96, 72)
SUN = DirectionalLight((0.5, 0.1, -1.0), 3.0)
BEHIND = props.quad((-2.9, -0.9, 1), (-2.9, 0.7, 1), (-1.6, 0.9, 1), (-1.6, -0.6, 1), replace(WHITE, double_sided=True))
EDGE = Scene([props.wall(-4), BEHIND], [SUN], AHEAD)  # what stands behind the camera casts a shadow before it


def visible(gpu: Gpu, scene: Scene, technique: Technique, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Drawn light over that without casters; 1 where there is none."""
    with Renderer(scene, size, gpu=gpu, volumetric="off", antialiasing="none", shadow=technique) as renderer:
        renderer.draw()
        base = renderer.base()[..., 0].astype(float)
        renderer.draw(casters=False)
        full = renderer.base()[..., 0].astype(float)
    return np.where(full > 0, base / np.where(full > 0, full, 1), 1)


def smoothed(image: np.ndarray, radius: int, sigma: float) -> np.ndarray:
    """A Gaussian over 2·radius + 1 pixels each way, its sum 1; the border goes on beyond the picture."""
    weights = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    weights /= weights.sum()
    for axis in (0, 1):
        padded = np.pad(image, [(radius, radius) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        image = sum(w * np.take(padded, np.arange(image.shape[axis]) + i, axis) for i, w in enumerate(weights))
    return image


@pytest.mark.parametrize(("radius", "sigma"), [(1, 0.5), (8, 4.0), (20, 30.0)])
@pytest.mark.parametrize("depth_aware", [False, True])
def test_on_a_plane_it_is_the_gaussian_of_the_maps_answer(
    gpu: Gpu, radius: int, sigma: float, depth_aware: bool
) -> None:
    hard = visible(gpu, EDGE, Blurred(radius=0))
    soft = visible(gpu, EDGE, Blurred(radius=radius, sigma=sigma, depth_aware=depth_aware))
    assert 0.02 < (hard == 0).mean() < 0.5
    # Two roundings to a byte, and half floats.
    np.testing.assert_allclose(soft, smoothed(hard, radius, sigma), atol=1.2 / 255)
    if radius < 20:
        assert soft.mean() == pytest.approx(hard.mean(), abs=1e-3), "the kernel's sum is 1"
        assert soft.min() < 0.02


@pytest.mark.parametrize("light", [SUN, PointLight((1, 1, -1), 9.0), SpotLight((0, 1, 0), (0, -0.2, -1), 30.0)])
@pytest.mark.parametrize("depth_aware", [False, True])
def test_even_light_stays_as_it_is(gpu: Gpu, light: Light, depth_aware: bool) -> None:
    scene = Scene([props.wall(-4)], [light], AHEAD)
    technique = Blurred(radius=10, sigma=5.0, depth_aware=depth_aware)
    with Renderer(scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none", shadow=technique) as renderer:
        renderer.draw()
        drawn = renderer.base()
        renderer.draw(casters=False)
        assert np.array_equal(drawn, renderer.base())
        assert drawn.max() > 0


def test_without_a_radius_it_is_the_map(gpu: Gpu) -> None:
    ours = props.shoot(gpu, EDGE, SIZE, shadow=Blurred(radius=0, size=256))
    assert np.array_equal(ours.base, props.shoot(gpu, EDGE, SIZE, shadow=ShadowMap(size=256)).base)


def test_the_air_is_the_maps(gpu: Gpu) -> None:
    scene = EDGE.with_(medium=replace(EDGE.medium, scattering=0.05, bounds=((-6, -6, -8), (6, 6, 3))))
    march = March(steps=32)
    ours, maps = (
        props.shoot(gpu, scene, (32, 24), volumetric=march, shadow=shadow).inscattered
        for shadow in (Blurred(size=256), ShadowMap(size=256))
    )
    assert ours.max() > 0
    assert np.array_equal(ours, maps)


def test_depth_aware_light_stops_at_edges_of_depth(gpu: Gpu) -> None:
    """A board in the sun before a wall in the shade: unaware, light and shade leak over its outline; aware, none do."""
    board = props.quad((-0.4, -0.5, -2), (0.4, -0.5, -2), (0.4, 0.5, -2), (-0.4, 0.5, -2))
    # A screen beside the picture hides the wall from the sun, and not the board.
    sun = DirectionalLight((1.0, 0.0, -0.4), 3.0)
    screen = props.quad((-6, -3, -3.9), (-6, -3, -0.6), (-6, 3, -0.6), (-6, 3, -3.9), replace(WHITE, double_sided=True))
    scene = Scene([props.wall(-4), board, screen], [sun], AHEAD)
    hit = props.cast(scene, props.rays(AHEAD, SIZE).origin, props.rays(AHEAD, SIZE).directions)
    on_board, on_wall = hit.instance == 1, hit.instance == 0
    # The rasteriser and the rays may differ in the outline's own pixels, which then are of the other surface.
    firm = np.all([np.roll(hit.instance, s, a) == hit.instance for a in (0, 1) for s in (-1, 1)], axis=0)
    hard = visible(gpu, scene, Blurred(radius=0))
    near = np.any([np.roll(on_board, s, a) for a in (0, 1) for s in range(-4, 5)], axis=0)
    assert np.median(hard[on_board]) == 1
    assert np.median(hard[on_wall & near]) == 0
    leaks = {}
    for aware in (False, True):
        soft = visible(gpu, scene, Blurred(radius=6, sigma=3.0, depth_aware=aware))
        leaks[aware] = np.abs(soft - np.where(on_board, 1, 0))[firm & (on_board | (on_wall & near))].max()
    assert leaks[False] > 0.2
    assert leaks[True] < 1.5 / 255


def test_every_light_has_its_own_image(gpu: Gpu) -> None:
    """The light of nine lights is the sum of what each gives alone."""
    lights: list[Light] = [DirectionalLight((0.1 * i - 0.2, 0.05 * i, -1), 0.3) for i in range(7)]
    lights += [PointLight((-2, 0.2, 3), 4.0), PointLight((-3, -0.2, 3), 4.0)]
    technique = Blurred(radius=3, sigma=1.5, size=256)
    together = props.shoot(gpu, EDGE.with_(lights=lights), (48, 36), shadow=technique).base
    alone = [props.shoot(gpu, EDGE.with_(lights=[light]), (48, 36), shadow=technique).base for light in lights]
    np.testing.assert_allclose(together, np.sum(alone, axis=0), atol=4e-3)
    assert all((a.min((0, 1)) < 0.2 * a.max((0, 1))).any() for a in alone[3:5])
