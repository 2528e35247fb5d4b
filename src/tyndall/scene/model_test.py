"""Plain data refuses what nobody could draw, in one line."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tyndall.gpu.params import ParameterError
from tyndall.lab.fingerprint import scene_hash
from tyndall.scene.model import DirectionalLight, Scene


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
