"""Temporal antialiasing converges to the area average, forgets what it should, and leaves a flat picture alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import props
import pytest
from props import AHEAD, WHITE

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Image, Material, Scene, Texture
from tyndall.techniques import Technique
from tyndall.techniques.antialiasing.none import NoAntialiasing
from tyndall.techniques.antialiasing.taa import Taa, halton
from tyndall.techniques.shadow.shadow_map import ShadowMap

SIZE = (24, 18)
OFFSET = 0.3
# Edges at every slope, of moderate contrast: the resolve weighs by brightness.
SPIKES = [
    props.quad(
        (1.6 * math.cos(a), 1.6 * math.sin(a), -4),
        (0.2 * math.cos(a + 0.2), 0.2 * math.sin(a + 0.2), -4),
        (1.6 * math.cos(a + 0.4), 1.6 * math.sin(a + 0.4), -4),
        (1.9 * math.cos(a + 0.2), 1.9 * math.sin(a + 0.2), -4),
        Material("spike", (1, 1, 1, 1), emissive=(0.5, 0.4, 0.2), double_sided=True),
    )
    for a in np.arange(OFFSET, 2 * math.pi + OFFSET, 0.9)
]
STAR = Scene(SPIKES, [], AHEAD, background=(0.2, 0.25, 0.3))


def renderer(gpu: Gpu, scene: Scene, technique: Technique, size: tuple[int, int] = SIZE) -> Renderer:
    return Renderer(
        scene, size, gpu=gpu, volumetric="off", shadow=ShadowMap(size=64), antialiasing=technique, tonemap="none"
    )


def area_average(gpu: Gpu, scene: Scene, factor: int = 16) -> np.ndarray:
    """The picture with ``factor``² samples a pixel, box-filtered."""
    with renderer(gpu, scene, NoAntialiasing(), (SIZE[0] * factor, SIZE[1] * factor)) as fine:
        fine.draw()
        image = fine.radiance().astype(float)
    return image.reshape(SIZE[1], factor, SIZE[0], factor, 3).mean(axis=(1, 3))


def rmse(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2)))


def test_a_still_picture_converges_to_the_area_average(gpu: Gpu) -> None:
    truth = area_average(gpu, STAR)
    errors = {}
    with renderer(gpu, STAR, Taa(blend=0.001)) as taa:
        for frame in range(1, 65):
            taa.draw()
            if frame in (1, 4, 16, 64):
                errors[frame] = rmse(taa.radiance(), truth)
    assert errors[1] > 0.03, "one sample a pixel has jagged edges"
    assert errors[4] < 0.6 * errors[1]
    assert errors[16] < 0.35 * errors[1]
    assert errors[64] <= errors[16] * 1.1


def test_the_default_smooths_edges(gpu: Gpu) -> None:
    truth = area_average(gpu, STAR)
    with renderer(gpu, STAR, NoAntialiasing()) as plain, renderer(gpu, STAR, Taa()) as taa:
        plain.draw()
        for _ in range(32):
            taa.draw()
        assert rmse(taa.radiance(), truth) < 0.4 * rmse(plain.radiance(), truth)


def test_a_flat_picture_stays_as_it_is(gpu: Gpu) -> None:
    scene = Scene([], [], AHEAD, background=(0.25, 0.5, 2.0))
    with renderer(gpu, scene, Taa()) as taa:
        for _ in range(20):
            taa.draw()
        np.testing.assert_allclose(taa.radiance(), np.broadcast_to([0.25, 0.5, 2.0], (*SIZE[::-1], 3)), rtol=3e-3)


def test_the_first_frame_after_a_restart_is_like_the_first(gpu: Gpu) -> None:
    with renderer(gpu, STAR, Taa()) as taa:
        taa.draw()
        first = taa.radiance()
        for _ in range(7):
            taa.draw()
        assert not np.array_equal(taa.radiance(), first)
        taa.restart()
        taa.draw()
        assert np.array_equal(taa.radiance(), first)


def test_no_ghost_after_the_camera_jumps(gpu: Gpu) -> None:
    """What was bright and is out of the picture leaves nothing behind on the dark that replaces it."""
    bright = Material("bright", (1, 1, 1, 1), emissive=(5, 5, 5))
    dim = Material("dim", (1, 1, 1, 1), emissive=(0.1, 0.1, 0.1))
    scene = Scene(
        [props.wall(-4, 3, bright), props.quad((6, -9, 20), (-6, -9, 20), (-6, 9, 20), (6, 9, 20), dim)], [], AHEAD
    )
    turned = replace(AHEAD, target=(0.0, 0.0, 1.0))
    with renderer(gpu, scene, Taa()) as taa:
        for _ in range(12):
            taa.draw()
        assert taa.radiance().max() > 4
        taa.draw(turned)
        after = [taa.radiance()]
        taa.draw(turned)
        after.append(taa.radiance())
        for image in after:
            assert image.max() < 0.15


@pytest.mark.parametrize("behind", ["wall", "sky"])
@pytest.mark.parametrize("way", ["slide", "turn"])
def test_a_moving_camera_drags_nothing_along(gpu: Gpu, behind: str, way: str) -> None:
    """A bright post before something dark: while the camera slides or turns, what is beside the post stays dark."""
    post = props.box((-0.3, -3, -3.1), (0.3, 3, -2.9), Material("post", (1, 1, 1, 1), emissive=(4, 4, 4)))
    wall = props.wall(-6, 20, Material("wall", (1, 1, 1, 1), emissive=(0.1, 0.1, 0.1)))
    scene = Scene([post, *([wall] if behind == "wall" else [])], [], AHEAD, background=(0.1, 0.1, 0.1))
    with renderer(gpu, scene, Taa()) as taa, renderer(gpu, scene, NoAntialiasing()) as plain:
        for _ in range(10):
            taa.draw()
        for step in range(16):
            x, turn = (0.05 * step, 0.0) if way == "slide" else (0.0, 0.02 * step)
            camera = replace(AHEAD, position=(x, 0, 0), target=(x + math.sin(turn), 0, -math.cos(turn)))
            taa.draw(camera)
            plain.draw(camera)
        moving, still = taa.radiance(), plain.radiance()
    away = np.ones(SIZE[0], bool)
    columns = np.flatnonzero((still > 1).any(axis=(0, 2)))
    away[max(0, columns.min() - 1) : columns.max() + 2] = False
    assert away.sum() > 10
    np.testing.assert_allclose(moving[:, away], 0.1, atol=0.02)


def test_reprojection_follows_a_surface(gpu: Gpu) -> None:
    """A sliding camera over a smooth texture: with the right motion vectors the picture stays the moved picture."""
    x = (0.5 + 0.5 * np.sin(np.linspace(0, 2 * np.pi, 64, endpoint=False))) * 255
    pixels = np.repeat(np.repeat(x[None, :, None], 64, axis=0), 4, axis=2).astype(np.uint8)
    pixels[..., 3] = 255
    material = replace(WHITE, base_color_texture=Texture(Image(pixels), scale=(4.0, 4.0)))
    scene = Scene([props.wall(-4, 12, material)], [], AHEAD, ambient=(1, 1, 1))
    with renderer(gpu, scene, Taa()) as taa, renderer(gpu, scene, NoAntialiasing()) as plain:
        for step in range(12):
            camera = replace(AHEAD, position=(0.07 * step, 0.03 * step, 0), target=(0.07 * step, 0.03 * step, -1))
            taa.draw(camera)
            plain.draw(camera)
        assert np.ptp(plain.radiance()[9]) > 0.5
        assert rmse(taa.radiance(), plain.radiance()) < 0.03


def test_samples_cover_the_pixel_evenly() -> None:
    """Halton's sequence in bases 2 and 3: centred, and in every quarter of the pixel equally often."""
    shifts = np.array([Taa(period=144).jitter(i) for i in range(144)])
    assert np.abs(shifts).max() < 0.5
    assert np.abs(shifts.mean(axis=0)).max() < 0.01
    counts = np.histogram2d(*shifts.T, bins=2, range=[[-0.5, 0.5]] * 2)[0]
    assert np.abs(counts - 36).max() <= 2
    assert [halton(i, 2) for i in (1, 2, 3, 4)] == [0.5, 0.25, 0.75, 0.125]
    assert halton(5, 3) == pytest.approx(7 / 9)


def test_two_runs_are_bit_identical(gpu: Gpu) -> None:
    images = []
    scene = STAR.with_(lights=(DirectionalLight((0.1, -0.2, -1)),), camera=Camera((0.1, 0, 0), (0, 0, -4)))
    for _ in range(2):
        with renderer(gpu, scene, Taa()) as taa:
            for _ in range(6):
                taa.draw()
            images.append(taa.radiance())
    assert np.array_equal(*images)


def test_the_brightest_light_stays_as_bright(gpu: Gpu) -> None:
    """The sun itself, in a picture that is kept as .exr: half a float goes up to 65504."""
    bright = Material("bright", (1, 1, 1, 1), emissive=(60_000, 30_000, 10))
    with renderer(gpu, Scene([props.wall(-4, material=bright)], [], AHEAD), Taa()) as made:
        for _ in range(4):
            made.draw()
        np.testing.assert_allclose(made.radiance()[5, 5], [60_000, 30_000, 10], rtol=0.02)
