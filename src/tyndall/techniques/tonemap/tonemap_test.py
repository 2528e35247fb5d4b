"""Tone mapping: the exact sRGB curve where nothing is mapped, monotone curves where something is."""

from __future__ import annotations

import numpy as np
import pytest

from tyndall.frame import pack_camera
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, Scene
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import View
from tyndall.techniques.tonemap.tonemap import Aces, Agx, Clip

_CAMERA = "package::wesl::camera::Camera"


def mapped(gpu: Gpu, technique: Aces | Agx | Clip, colours: np.ndarray, exposure: float = 0.0) -> np.ndarray:
    """The bytes (N, 3) of linear colours (N, 3)."""
    size = (len(colours), 1)
    image = np.ones((1, len(colours), 4), np.float32)
    image[0, :, :3] = colours
    source = gpu.texture("test.image", size, "rgba32float", owner="test", data=image)
    target = gpu.texture("test.picture", size, "rgba8unorm", owner="test")
    row = np.array([pack_camera(Camera(exposure=exposure), Scene(), size, gpu.dtype(_CAMERA))])
    camera = gpu.buffer("test.camera", row, owner="test", element=_CAMERA, usage="uniform")
    view = View(gpu, Scene(), size, "tonemap.test", technique, scope={"camera": camera.uniform()})
    technique.render(view, source, target)
    result = gpu.read_texture(target)[0, :, :3].astype(int)
    view.close()
    for resource in (source, target, camera):
        resource.destroy()
    gpu.forget_groups()
    return result


def srgb(x: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, as unrounded bytes."""
    x = np.clip(x, 0, 1)
    return 255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


GREYS = np.repeat(np.concatenate([[0], np.geomspace(1e-5, 100, 400)])[:, None], 3, axis=1)


def test_none_is_exactly_srgb(gpu: Gpu) -> None:
    ramp = np.repeat(np.linspace(-0.1, 1.2, 1000)[:, None], 3, axis=1)
    # Half a byte of rounding, and what a GPU's own pow and rounding may add.
    assert np.abs(mapped(gpu, Clip(), ramp) - srgb(ramp)).max() <= 0.6
    colours = np.random.default_rng(5).random((200, 3))
    assert np.abs(mapped(gpu, Clip(), colours) - srgb(colours)).max() <= 0.6


def test_every_byte_survives_the_way_there_and_back(gpu: Gpu) -> None:
    byte = np.arange(256)
    x = byte / 255
    linear = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    assert np.array_equal(mapped(gpu, Clip(), np.repeat(linear[:, None], 3, axis=1))[:, 0], byte)


@pytest.mark.parametrize("cls", [Aces, Agx])
def test_curves_are_monotone_and_keep_grey_grey(gpu: Gpu, cls: type[Aces | Agx]) -> None:
    got = mapped(gpu, cls(dither=0.0), GREYS)
    assert (np.diff(got, axis=0) >= 0).all()
    assert np.ptp(got, axis=1).max() <= 2
    assert got[0].max() <= 2, "black stays black"
    assert got[-1].min() >= 235, "a hundred times white is white"
    middle = mapped(gpu, cls(dither=0.0), np.full((1, 3), 0.18))[0, 0]
    assert 85 < middle < 140, "middle grey is in the middle"
    assert len(np.unique(got[:, 0])) > 140


def test_aces_is_hills_fit(gpu: Gpu) -> None:
    """The fit's rational function of a grey, whose matrices leave greys as they are but for a factor near 1."""
    v = GREYS[:, 0]
    fitted = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    assert np.abs(mapped(gpu, Aces(dither=0.0), GREYS)[:, 0] - srgb(fitted)).max() <= 1.5


@pytest.mark.parametrize("cls", [Aces, Agx])
def test_hue_of_a_bright_light_goes_towards_white(gpu: Gpu, cls: type[Aces | Agx]) -> None:
    red = mapped(gpu, cls(dither=0.0), np.array([[0.5, 0.02, 0.02], [50.0, 2.0, 2.0]]))
    assert red[0, 0] > 3 * red[0, 1]
    assert red[1, 1] > red[0, 1] + 50


@pytest.mark.parametrize("name", FAMILIES["tonemap"].members)
def test_exposure_comes_before_the_curve(gpu: Gpu, name: str) -> None:
    technique = FAMILIES["tonemap"].make(name, changes={"dither": 0})
    brighter = mapped(gpu, technique, GREYS, exposure=1.5)
    assert np.array_equal(brighter, mapped(gpu, technique, np.float32(GREYS) * np.float32(2**1.5)))


@pytest.mark.parametrize("name", FAMILIES["tonemap"].members)
def test_dither_is_half_a_byte_either_way_and_unbiased(gpu: Gpu, name: str) -> None:
    value = np.full((4096, 3), 0.1)
    plain = mapped(gpu, FAMILIES["tonemap"].make(name, changes={"dither": 0}), value).astype(float)
    dithered = mapped(gpu, FAMILIES["tonemap"].make(name, changes={"dither": 0.5}), value).astype(float)
    assert np.ptp(plain) <= 3
    assert set(np.unique(dithered[:, 1])) <= {plain[0, 1] - 1, plain[0, 1], plain[0, 1] + 1}
    assert len(np.unique(dithered[:, 1])) == 2
    assert abs(dithered.mean() - plain.mean()) < 0.51


@pytest.mark.parametrize("name", FAMILIES["tonemap"].members)
def test_nothing_is_too_bright_or_not_a_number(gpu: Gpu, name: str) -> None:
    fierce = np.array([[65000.0, 0, 0], [0, 65000, 65000], [1e-8, 0, 1e-8], [65000, 65000, 65000]])
    got = mapped(gpu, FAMILIES["tonemap"].make(name), fierce)
    assert (got[3] >= 235).all()
    assert got[2].max() <= 3
