"""The implicit scenes: as many nodes as they say, slopes of at most 1, boxes that hold them, and motion from rest."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Implicit, Scene, transforms
from tyndall.sdf.program import Kinds, compile_shape
from tyndall.sdf.scenes import NODES, jumper, portrait, snail, swarm, temple
from tyndall.sdf.scenes.parts import curve, limb, nearer, paint
from tyndall.sdf.scenes.portrait import laid
from tyndall.sdf.scenes.swarm import WAVE, morton
from tyndall.sdf.shape import Floats, Shape
from tyndall.sdf.solids import sphere

MAKERS: dict[str, Callable[..., Scene]] = {
    "swarm": swarm, "portrait": portrait, "snail": snail, "jumper": jumper, "temple": temple,
}  # fmt: skip
FEWEST = {"swarm": 2, "portrait": 120, "snail": 80, "jumper": 60, "temple": 150}  # nodes


@pytest.fixture(scope="module", params=list(MAKERS))
def scene(request: pytest.FixtureRequest) -> Scene:
    return MAKERS[request.param]()


def shape_of(one: Implicit) -> Shape:
    assert isinstance(one.shape, Shape)
    return one.shape


def nodes(scene: Scene) -> int:
    return sum(shape_of(one).count for one in scene.implicits)


def distances(scene: Scene, points: Floats) -> Floats:
    """(N,) signed distances in the world, by the oracle."""
    values = []
    for one in scene.implicits:
        inverse = np.linalg.inv(np.array(one.transform))
        values.append(shape_of(one)(points @ inverse[:3, :3].T + inverse[:3, 3]))
    return np.asarray(np.min(values, axis=0))


def test_the_number_of_nodes_is_known(scene: Scene) -> None:
    assert nodes(scene) == NODES[scene.name] >= FEWEST[scene.name]
    assert scene.triangle_count == 0


def test_objects_are_a_handful_with_names_of_their_own(scene: Scene) -> None:
    names = [one.name for one in scene.implicits]
    assert 2 <= len(names) <= 10
    assert len(set(names)) == len(names)
    assert all(names)


def test_what_has_no_end_is_simple(scene: Scene) -> None:
    for one in scene.implicits:
        assert one.bounds is not None or shape_of(one).count <= 4, one.name


def test_slopes_are_at_most_one(scene: Scene) -> None:
    for one in scene.implicits:
        shape = shape_of(one)
        assert shape.lipschitz <= 1 + 1e-9, one.name
        if shape.count > 3000:
            continue
        low, high = shape.box if one.bounds is not None else (np.full(3, -3.0), np.full(3, 3.0))
        random = np.random.default_rng(3)
        a = random.uniform(low, high, (600, 3))
        b = a + random.normal(0, 0.02, (600, 3))
        apart = np.linalg.norm(b - a, axis=1)
        assert (np.abs(shape(a) - shape(b)) <= apart * (1 + 1e-6) + 1e-9).all(), one.name


def test_nothing_is_outside_of_the_boxes(scene: Scene) -> None:
    for one in scene.implicits:
        shape = shape_of(one)
        if one.bounds is None or shape.count > 3000:
            continue
        low, high = shape.box
        points = np.random.default_rng(5).uniform(low - 0.4 * (high - low), high + 0.4 * (high - low), (1500, 3))
        outside = ((points < low) | (points > high)).any(axis=1)
        assert (shape(points[outside]) > 0).all(), one.name


def test_the_camera_is_in_the_open(scene: Scene) -> None:
    assert distances(scene, np.array([scene.camera.position]))[0] > 0.1


def test_it_stands_still_at_rest(scene: Scene) -> None:
    assert scene.motion is not None
    for name, value in scene.motion(0.0).items():
        assert np.allclose(transforms(name, value), np.eye(4), atol=1e-6), name


def test_what_moves_is_there_and_stays_in_its_room(scene: Scene) -> None:
    assert scene.motion is not None
    parts: dict[str, int] = {}
    for one in scene.implicits:
        parts[one.name] = 1
        for name, found in compile_shape(shape_of(one), Kinds()).names.items():
            parts[name] = parts.get(name, 0) + len(found)
    for time in (0.4, 1.9, 7.3):
        for name, value in scene.motion(time).items():
            assert len(transforms(name, value)) == parts[name], name
    if nodes(scene) > 3000:
        return
    low, high = scene.bounds
    for time in (0.3, 0.62, 1.1, 2.9):
        moved = scene.at_time(time)
        assert (moved.bounds[0] >= low - 1e-6).all()
        assert (moved.bounds[1] <= high + 1e-6).all()


def test_it_moves(scene: Scene) -> None:
    assert scene.motion is not None
    early, late = scene.motion(0.0), scene.motion(1.234)
    assert any(not np.allclose(early[name], late[name], atol=1e-3) for name in early)


def test_the_same_for_a_seed(scene: Scene) -> None:
    again = MAKERS[scene.name]()
    assert [one.shape for one in again.implicits] == [one.shape for one in scene.implicits]
    if scene.name != "portrait":  # nothing in it is random
        other = MAKERS[scene.name](seed=1)
        assert [one.shape for one in other.implicits] != [one.shape for one in scene.implicits]


@pytest.mark.parametrize("name", MAKERS)
def test_lights_share_what_one_brings(name: str) -> None:
    small: dict[str, Any] = {"count": 10} if name == "swarm" else {}
    one, five = MAKERS[name](**small), MAKERS[name](lights=5, **small)
    assert len(five.lights) == 5
    assert sum(light.intensity for light in five.lights) == pytest.approx(one.lights[0].intensity)
    with pytest.raises(ParameterError, match="lights"):
        MAKERS[name](lights=0, **small)


# --- the jumper ---------------------------------------------------------------------------------------------------


def test_the_jumper_lands_on_the_ground() -> None:
    scene = jumper()
    ground = shape_of(next(one for one in scene.implicits if one.name == "ground"))
    lowest = []
    for time in np.linspace(0, 2.2, 23):
        one = next(o for o in scene.at_time(float(time)).implicits if o.name == "jumper")
        assert one.bounds is not None
        lowest.append(float(one.bounds[0][1]))
        place = np.array(one.transform)[:3, 3]
        assert ground(place[None])[0] > -0.12
    assert max(lowest) > 0.8
    assert min(lowest) < 0.2


# --- the swarm ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 10, 100])
def test_a_swarm_has_the_count_that_it_is_asked_for(count: int) -> None:
    scene = swarm(count)
    assert scene.motion is not None
    assert len(np.asarray(scene.motion(2.0)["swarm"])) == count
    assert len(compile_shape(shape_of(scene.implicits[0]), Kinds()).names["swarm"]) == count


def test_neighbours_in_the_tree_are_near() -> None:
    scene = swarm(1000)
    places: Floats = scene.motion.places  # type: ignore[union-attr]
    step = np.linalg.norm(np.diff(places, axis=0), axis=1)
    mixed = np.random.default_rng(0).permutation(places)
    assert np.median(step) < 0.15 * np.median(np.linalg.norm(np.diff(mixed, axis=0), axis=1))


def test_a_wave_moves_the_swarm_little_and_neighbours_together() -> None:
    scene = swarm(1000)
    assert scene.motion is not None
    places: Floats = scene.motion.places  # type: ignore[attr-defined]
    ways = np.asarray(scene.motion(3.3)["swarm"], np.float64)
    assert np.abs(ways).max() <= 2 * WAVE + 1e-6
    near = np.linalg.norm(np.diff(places, axis=0), axis=1)
    apart = np.linalg.norm(np.diff(ways, axis=0), axis=1)
    assert (apart <= 1.6 * near + 1e-6).all()


def test_morton_keys_go_through_octants_in_order() -> None:
    corners = np.array([[(i >> axis) & 1 for axis in range(3)] for i in range(8)], np.float64)
    keys = morton(0.25 + 0.5 * corners, np.zeros(3), np.ones(3))
    assert all(a < b for a, b in pairwise(keys))
    assert [int(k) >> 60 for k in keys] == list(range(8))


@pytest.mark.parametrize("count", [0, -3, 1.5, 100_001])
def test_a_wrong_count_is_refused(count: Any) -> None:
    with pytest.raises(ParameterError, match="count"):
        swarm(count)


# --- parts --------------------------------------------------------------------------------------------------------


def test_a_limb_touches_both_of_its_balls() -> None:
    shape = limb((0, 0, 0), (0, 2, 0), 0.5, 0.2)
    assert np.allclose(shape([[0, -0.5, 0], [0, 2.2, 0], [0, 0, 0]]), [0, 0, -0.5])
    assert np.allclose(limb((0, 0, 0), (0.1, 0, 0), 0.5, 0.2)([[0, 0.5, 0]]), 0)


def test_a_curve_goes_through_its_points() -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1.0)])
    assert np.allclose(curve(points, 4), points)


def test_what_is_nearer_is_seen_in_the_same_direction() -> None:
    shape = nearer(sphere(1.0).at(0, 0, -10), (0, 0, 2), 0.5)
    assert np.allclose(shape([[0, 0, -4], [0, 0.5, -4]]), [-0.5, 0])


def test_paint_is_linear() -> None:
    assert np.allclose(paint("#ff8000").base_color, (1, 0.21586, 0, 1), atol=1e-4)
    assert paint("#ffffff", glow=2.0).emissive == (2.0, 2.0, 2.0)


def test_what_is_laid_onto_a_shape_is_on_its_surface() -> None:
    ball = sphere(1.0)
    places = laid(ball, [(0.0, 0.0), (0.3, -0.4)])
    assert np.allclose(places[:, 2], np.sqrt(1 - (places[:, :2] ** 2).sum(axis=1)), atol=1e-6)
    assert np.allclose(ball(laid(ball, [(0.0, 0.0)], 0.1)), 0.1, atol=1e-6)
