"""Bundled scenes of both kinds by name."""

from __future__ import annotations

import pytest

import tyndall as ty
from tyndall.gpu.params import ParameterError
from tyndall.lab.bundled import NODES, SCENES, TRIANGLES, named
from tyndall.lab.scenes import open_scene


def test_every_scene_is_of_one_kind() -> None:
    assert list(TRIANGLES) == list(NODES) == list(SCENES)
    for name in SCENES:
        assert (TRIANGLES[name] > 0) != (NODES[name] > 0)
        assert getattr(ty.scenes, name) is SCENES[name]


def test_a_size_may_follow_a_name() -> None:
    make = named("swarm:12")
    assert make is not None
    assert len(make(lights=2).lights) == 2
    assert make().motion is not None
    assert named("shadows:1000") is not None
    assert named("swarms") is named("swarms:3") is None
    assert open_scene("swarm:12").implicits[0].name == "drops"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("swarm:many", "count: 'many' is no number of primitives; swarm:1000 has 1,000"),
        ("swarm:0", "count: 0 is outside 1 … 100000"),
        ("temple:3", "count: temple has no number of primitives; only swarm has as many as it is asked for"),
        ("box:3", "triangles: box has 4,968; only shadows has as many as it is asked for"),
    ],
)
def test_a_wrong_size_is_one_line(name: str, message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        open_scene(name)
    assert str(caught.value) == message
