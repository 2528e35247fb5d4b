"""Plain data refuses what nobody could draw, in one line."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tyndall.gpu.params import ParameterError
from tyndall.lab.fingerprint import scene_hash
from tyndall.scene.model import DirectionalLight, Implicit, Scene
from tyndall.sdf import Z, box, sphere
from tyndall.sdf.shape import rotation


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"background": (0, math.nan, 0)}, "background: nan is not a finite number"),
        ({"background": "red"}, "background: 'red' is not 3 numbers"),
        ({"ambient": (-1, 0, 0)}, "ambient: -1 is outside ≥ 0"),
        ({"ambient": 0.5}, "ambient: 0.5 is not 3 numbers"),
        (
            {"lights": (DirectionalLight(), "sun")},
            "lights[1]: str is not DirectionalLight or PointLight or SpotLight or RectLight",
        ),
        ({"instances": [DirectionalLight()]}, "instances[0]: DirectionalLight is not Instance"),
    ],
)
def test_a_scene_of_anything_else_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        Scene(**changes)
    assert str(caught.value) == message


def test_whole_numbers_are_the_same_scene() -> None:
    """What is saved and loaded comes back as floats."""
    assert scene_hash(Scene(background=(0, 0, 1))) == scene_hash(Scene(background=(0.0, 0.0, 1.0)))


def test_a_moment_has_everything_where_the_motion_says() -> None:
    """Objects in the world, parts in the space that holds them, parts of parts with them."""
    hand = sphere(0.1).named("hand").at(1, 0, 0)
    arm = (box(0.2) | hand).named("arm").rotate(math.pi / 2, Z)
    turn = rotation(math.pi, Z)
    implicits = [Implicit(arm, name="body"), Implicit(sphere(0.5).named("hand"))]
    scene = Scene(
        implicits=implicits, motion=lambda t: {"body": [(t, 0, 0)], "arm": turn, "hand": [(0, 0, t), (0, t, 0)]}
    )
    body, other = scene.at_time(2.0).implicits
    np.testing.assert_allclose(np.array(body.transform)[:3, 3], (2, 0, 0))
    # The hand at (1, 0, 2) in the arm, which is turned half round and then a quarter.
    np.testing.assert_allclose(body.shape([(0, -1, 2), (0, 1, 0)]) < 0, (True, False))
    np.testing.assert_allclose(other.shape([(0, 2, 0)]), -0.5)
    assert scene.at_time(2.0).motion is None
    still = Scene(implicits=implicits)
    assert still.at_time(1.0) is still


def test_a_motion_of_too_few_is_refused() -> None:
    two = [Implicit(sphere(1), name="ball")] * 2
    with pytest.raises(ParameterError, match="fewer transforms"):
        Scene(implicits=two, motion=lambda _: {"ball": [(1, 0, 0)]}).at_time(0)
    with pytest.raises(ParameterError, match="ball: shape"):
        Scene(implicits=two, motion=lambda _: {"ball": [1, 0, 0]}).at_time(0)


def test_the_room_is_part_of_the_bounds() -> None:
    scene = Scene(implicits=[Implicit(sphere(1))], room=((-5, 0, 0), (0, 0.5, 3)))
    np.testing.assert_array_equal(scene.bounds, ((-5, -1, -1), (1, 1, 3)))
    with pytest.raises(ParameterError, match="below the lower"):
        Scene(room=((0, 0, 0), (1, -1, 1)))
