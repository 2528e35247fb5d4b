"""Truths made ready: their light by kind, their noise, and where edges of shadows are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.lab import standard
from tyndall.lab.stage import Stage
from tyndall.lab.standard import Standard, prepare
from tyndall.lab.truth import Truth
from tyndall.scene.model import Camera, DirectionalLight, Material, Medium, Scene

SIZE = (64, 36)
WHITE = Material("white", (0.8, 0.8, 0.8, 1), roughness=1)
GREY = Material("grey", (0.3, 0.3, 0.3, 1), roughness=1)


def post_on_a_floor() -> Scene:
    """Seen from above: a high box on a floor, whose shadow falls to the right; ambient light, and a checkered floor."""
    squares = [
        props.quad((x, 0, z + 1), (x + 1, 0, z + 1), (x + 1, 0, z), (x, 0, z), WHITE if (x + z) % 2 else GREY)
        for x in range(-4, 4)
        for z in range(-3, 3)
    ]
    return Scene(
        [*squares, props.box((-1.2, 0, -0.6), (-0.8, 1, 0.6), WHITE)],
        [DirectionalLight((1, -1, 0), 3.0)],
        Camera((0, 6, 0.001), (0, 0, 0), fov=0.8),
        Medium(0.02, 0.0, bounds=((-4, 0, -3), (4, 5, 3))),
        ambient=(0.2, 0.2, 0.2),
    )


@pytest.fixture(scope="module")
def made(gpu: Gpu) -> tuple[Truth, Standard]:
    """The truth of the post's picture is what a fine shadow map draws, with a noise of 1 % in the air."""
    with Stage(post_on_a_floor(), SIZE, adapter=gpu) as stage:
        still = stage.shafts()
        none = np.zeros_like(still.light)
        noise = np.full_like(none, 0.01 * still.light.mean())
        truth = Truth(
            judge="test",
            radiance=still.picture.radiance,
            inscattered=still.light,
            surfaces=still.surfaces,
            depth=still.picture.depth,
            radiance_error=noise,
            inscattered_error=noise,
            samples=7,
            seconds=2.5,
            size=SIZE,
            settings={"target": 0.01},
        )
        return truth, prepare(stage, "shadow", truth)


def test_shadows_have_edges_and_squares_of_the_floor_have_none(made: tuple[Truth, Standard]) -> None:
    """The shadow of the post, 1 m high under 45°, ends 1 m to the right of its upper edge, at x = 0.2."""
    _, ready = made
    edges = ready.targets["surfaces"].edges
    assert edges is not None
    half = 6 * np.tan(0.4)  # metres from the middle to the upper edge of the picture

    def column(x: float) -> int:
        return round(SIZE[0] / 2 + x / half * SIZE[1] / 2)

    middle = edges[SIZE[1] // 2]
    assert middle[column(0.2) - 1 : column(0.2) + 1].any()
    assert not middle[column(0.2) + 4 :].any()
    assert not middle[: column(-1.5)].any()
    shadow = slice(column(-0.6) + 2, column(0.2) - 3)
    assert not middle[shadow].any()
    assert 0 < edges.mean() < 0.2


def test_light_of_every_kind_has_its_own_noise(made: tuple[Truth, Standard]) -> None:
    truth, ready = made
    assert set(ready.targets) == {"surfaces", "radiance"}
    assert ready.targets["surfaces"].error is None, "all of the noise is the air's"
    assert ready.noise["surfaces"] == 0
    assert ready.noise["radiance"] == pytest.approx(0.01 * truth.inscattered.mean() / truth.radiance.mean(), rel=1e-4)
    assert "7 samples a pixel, 2.5 s" in ready.caption()
    document = ready.to_json("reference.png")
    assert document["judge"] == "test"
    assert document["still_exr"] == "reference.exr"
    assert document["boundary_share"]["surfaces"] == pytest.approx(ready.targets["surfaces"].edges.mean(), rel=1e-3)


def test_a_truth_without_surfaces_has_the_rest_of_the_picture(gpu: Gpu, made: tuple[Truth, Standard]) -> None:
    truth, ready = made
    with Stage(post_on_a_floor(), SIZE, adapter=gpu) as stage:
        unknown = prepare(stage, "shadow", replace(truth, surfaces=None, depth=None))
    np.testing.assert_allclose(
        unknown.targets["surfaces"].light, ready.targets["surfaces"].light, rtol=3e-3, atol=1e-3 * truth.radiance.max()
    )
    np.testing.assert_array_equal(unknown.picture.depth, ready.picture.depth)


def test_a_truth_that_is_not_finite_is_refused(gpu: Gpu, made: tuple[Truth, Standard]) -> None:
    truth, _ = made
    unknown = truth.radiance_error.copy()
    unknown[3, 2] = np.nan
    with Stage(post_on_a_floor(), SIZE, adapter=gpu) as stage, pytest.raises(ParameterError, match="not finite"):
        prepare(stage, "shadow", replace(truth, radiance_error=unknown))


def test_its_files_hold_its_light_and_its_error(made: tuple[Truth, Standard], tmp_path: Path) -> None:
    import OpenEXR

    truth, ready = made
    ready.save(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"reference.png", "reference.exr"}
    with OpenEXR.File(str(tmp_path / "reference.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    for layer, light in (("", truth.radiance), ("inscatter.", truth.inscattered), ("surfaces.", truth.surfaces)):
        for i, c in enumerate("RGB"):
            np.testing.assert_array_equal(channels[layer + c], light[..., i])
    np.testing.assert_array_equal(channels["radiance_error.R"], truth.radiance_error[..., 0])
    assert "Z" in channels


@pytest.mark.parametrize("truth", [None, "traced", "mitsuba", "march"])
def test_who_judges_volumetric_light(truth: str | None) -> None:
    standard.check("volumetric", truth)


def test_the_march_judges_no_shadows() -> None:
    with pytest.raises(ParameterError, match="truth: 'march'"):
        standard.check("shadow", "march")


@pytest.mark.parametrize("judge", ["traced", "mitsuba"])
def test_the_default_ends_and_looks_through_the_middle_of_pixels(judge: str) -> None:
    settings = standard.default_settings(judge)
    assert 0 < settings.seconds <= 120
    standard.check("shadow", judge, settings)
