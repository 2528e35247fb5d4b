"""Views of a frame: what is known of a sphere is what they show."""

from __future__ import annotations

import numpy as np
import props
import pytest

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.lab.views import VIEWS, render_view, view
from tyndall.scene.model import Implicit, Material, Scene
from tyndall.sdf import sphere
from tyndall.sdf.shape import Shape
from tyndall.techniques.shadow.shadow_map import ShadowMap

SIZE = (64, 48)
BALL = Material(base_color=(0.25, 0.5, 1, 1), roughness=0.4)
MATRIX = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, -2), (0, 0, 0, 1))
SCENE = Scene([props.wall(-4, 1)], camera=props.AHEAD, implicits=[Implicit(sphere(0.5), MATRIX, BALL)], name="one")


def test_each_shows_what_is_known(gpu: Gpu) -> None:
    with Renderer(SCENE, SIZE, gpu=gpu, volumetric="off", shadow=ShadowMap(size=16), antialiasing="none") as renderer:
        renderer.draw()
        shown = {name: view(renderer, name).astype(int) for name in VIEWS if name != "slice"}
        steps, ids = renderer.surface("steps"), renderer.surface("ids")
        with pytest.raises(ParameterError, match="did you mean 'albedo'"):
            renderer.surface("albdo")
    middle, corner = (24, 32), (1, 1)
    assert np.abs(shown["normals"][middle] - (128, 128, 255)).max() <= 6
    assert np.abs(shown["albedo"][middle] - 255 * np.array([0.25, 0.5, 1]) ** (1 / 2.2)).max() <= 2
    assert np.abs(shown["roughness"][middle] - 102).max() <= 1
    assert shown["depth"][middle][0] == 255
    assert (ids[middle], ids[corner]) == (1, 0)
    assert 1 <= steps[middle] < 20
    assert steps[corner] == 0
    for name in shown:
        assert not shown[name][corner].any(), f"{name}: the background is black"
        assert shown[name][middle].any()


def test_a_legend_stands_where_there_is_room(gpu: Gpu) -> None:
    picture = render_view(SCENE, "steps", (240, 135), adapter=gpu)
    assert picture.pixels.shape == (135, 240, 3)
    assert picture.pixels[-36:, 8:104].std() > 20
    assert dict(picture.metadata)["view"] == "steps"


def test_a_slice_goes_through_the_middle(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    held: dict[str, float] = {}

    class Seen:
        pixels = np.zeros((70, 64, 3), np.uint8)

    def show_slice(shape: Shape, **given: float) -> Seen:
        held.update(given)
        np.testing.assert_allclose(shape([(0, 0, -2), (0, 0, -1)]), (-0.5, 0.5))
        return Seen()

    monkeypatch.setattr(Shape, "show_slice", show_slice)
    assert render_view(SCENE, "slice", (32, 24), adapter=gpu).size == (64, 70)
    assert held == {"z": -2.0, "pixels": 64}


def test_a_wrong_name_is_refused(gpu: Gpu) -> None:
    with pytest.raises(ParameterError, match="no 'step' — did you mean 'steps'"):
        render_view(SCENE, "step", SIZE, adapter=gpu)
    with pytest.raises(ParameterError, match="one has none"):
        render_view(SCENE.with_(implicits=()), "ids", SIZE, adapter=gpu)
