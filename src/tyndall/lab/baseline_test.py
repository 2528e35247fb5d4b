"""The plain loop draws the scene: its silhouette, shadow, occlusion and colours, the same in each of its forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu
from tyndall.lab.baseline import OWNER, Baseline, Loop, long_lists
from tyndall.lab.measure import measure
from tyndall.scene.model import Camera, DirectionalLight, Implicit, Material, Scene
from tyndall.sdf import box, sphere, union

SIZE = (48, 32)
RED, GREY = Material("red", (0.8, 0.1, 0.1, 1.0)), Material("grey", (0.5, 0.5, 0.5, 1.0))
DOWN = DirectionalLight((0.0, -1.0, 0.0), 3.0)
BALL = sphere(0.5).material(RED).named("ball")
SCENE = Scene(
    lights=(DOWN,),
    camera=Camera((0, 2, 4), (0, 0, 0)),
    ambient=(0.3, 0.3, 0.3),
    implicits=(Implicit(BALL.at(0, 0.7)), Implicit(box((6, 0.2, 6)).at(0, -0.1), material=GREY)),
)


def drawn(gpu: Gpu, scene: Scene = SCENE, **given: object) -> NDArray[np.int64]:
    with Baseline(gpu, scene, SIZE, **given) as baseline:  # type: ignore[arg-type]
        baseline.draw()
        return baseline.picture().astype(np.int64)


def test_a_ball_stands_in_its_light_and_throws_a_shadow(gpu: Gpu) -> None:
    """Where it is, by projection; red; and dark below it, where a ray towards the sun meets it."""
    picture = drawn(gpu, stage="compute")
    dark = drawn(gpu, stage="compute", settings=Loop.of(SCENE, SIZE, shadows=0))
    red = picture[..., 0] > 1.5 * picture[..., 1]
    rows, columns = np.nonzero(red)
    assert abs(columns.mean() - (SIZE[0] - 1) / 2) < 0.3
    # A ball of 0.5 m in a view depth of 18.6/√20; a ray that passes within half a pixel counts.
    radius = 0.5 / (18.6 / np.sqrt(20)) * SIZE[1] / 2 / np.tan(np.radians(22.5)) + 0.5
    assert red.sum() == pytest.approx(np.pi * radius**2, rel=0.1)
    shaded = (dark - picture).sum(axis=2) > 30
    assert 10 < shaded.sum() < 200
    assert not shaded[: SIZE[1] // 3].any()
    below = np.nonzero(shaded)[0].mean()
    assert below > rows.mean()


def test_occlusion_dims_what_is_near_something(gpu: Gpu) -> None:
    with_it, without = (
        drawn(gpu, stage="compute", settings=Loop.of(SCENE, SIZE, occlusion=on, shadows=0)) for on in (1, 0)
    )
    assert (with_it <= without).all()
    assert 20 < ((without - with_it).sum(axis=2) > 5).sum() < SIZE[0] * SIZE[1] / 2


def test_a_light_of_some_size_has_soft_shadows(gpu: Gpu) -> None:
    sun = DirectionalLight((0.0, -1.0, 0.0), 3.0, angular_diameter=0.5)
    partial = []
    for light in (sun, DOWN):
        scene = SCENE.with_(lights=(light,))
        lit = drawn(gpu, scene, stage="compute", settings=Loop.of(scene, SIZE, shadows=0))
        shade = (lit - drawn(gpu, scene, stage="compute"))[SIZE[1] // 2 :, :, 1]
        partial.append(((shade > 0.1 * shade.max()) & (shade < 0.7 * shade.max())).sum())
    assert partial[0] > 2 * partial[1]


def test_all_of_its_forms_draw_the_same(gpu: Gpu) -> None:
    listed = union(*(sphere(0.2).at(x, 0.5) for x in (-1, 0, 1)), smooth=0.01)
    scene = SCENE.with_(implicits=(Implicit(listed, material=RED), SCENE.implicits[1]))
    first = drawn(gpu, scene, stage="fragment")
    for stage in ("fragment", "compute"):
        for loops in ((), (0,)):
            other = drawn(gpu, scene, stage=stage, loops=loops)
            assert (np.abs(other - first).max(axis=2) > 2).mean() < 0.01, (stage, loops)


def test_leaves_of_lists_move(gpu: Gpu) -> None:
    shape = union(BALL.at(0, 0.7), BALL.at(0, 0.7, -0.5))
    scene = SCENE.with_(implicits=(Implicit(shape), SCENE.implicits[1]))
    with Baseline(gpu, scene, SIZE, stage="compute", loops=[0]) as baseline:
        baseline.draw()
        before = baseline.picture()
        baseline.draw(moves={"ball": np.array([[0.5, 0, 0], [0.5, 0, 0]])})
        moved = baseline.picture()
        red = [np.nonzero(p[..., 0] > 1.5 * p[..., 1].astype(int))[1].mean() for p in (before, moved)]
        assert red[1] > red[0] + 3
        found = measure(baseline, frames=2, warmup=0)
        assert "baseline.compute" in found.passes
        assert baseline.compile_ms > 0
        assert baseline.memory()[OWNER] > 4 * SIZE[0] * SIZE[1]
    assert OWNER not in gpu.ledger.by_owner()


def test_long_unions_are_found() -> None:
    many = union(*(sphere(0.1).at(x) for x in range(70)))
    few = union(*(sphere(0.1).at(x) for x in range(5)))
    assert long_lists(Scene(implicits=(Implicit(few), Implicit(many)))) == [1]


def test_the_loop_knows_the_scenes_box_only_where_it_has_one() -> None:
    loop = Loop.of(SCENE, SIZE)
    assert loop.low == pytest.approx((-3, -0.2, -3), abs=0.02)
    assert loop.high == pytest.approx((3, 1.2, 3), abs=0.02)
    assert loop.pace == 1
    twice = Implicit(sphere(1).scale((1, 2, 1)))
    assert Loop.of(Scene(implicits=(twice,)), SIZE).pace <= 1
