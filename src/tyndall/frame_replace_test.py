"""Other implicit surfaces while a renderer runs: the old picture until the new one is ready, and then that of a new
renderer, pixel by pixel."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import props
import pytest

from tyndall.content.implicit import Fields
from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Camera, DirectionalLight, Implicit, Material, Medium, Scene, Volume
from tyndall.sdf import box, circle, snippet, sphere, torus, union
from tyndall.sdf.sandbox import SnippetError
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import Unsupported
from tyndall.techniques.shadow.shadow_map import ShadowMap

SIZE = (32, 24)
QUIET: dict[str, Any] = {"volumetric": "off", "shadow": ShadowMap(size=16), "antialiasing": "none"}
RED = Material(base_color=(0.8, 0.1, 0.1, 1))


def at(x: float, y: float, z: float) -> Any:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


PAIR = union(sphere(0.4).named("bead"), box(0.5).at(0.5), smooth=0.1)
LEFT, RIGHT = Implicit(PAIR, at(-0.9, 0.5, 0), name="left"), Implicit(sphere(0.4), at(0.9, 0.5, 0), name="right")
SCENE = Scene(
    [props.floor(0, 4)],
    [DirectionalLight((0.5, -1.0, -0.35), 3.0)],
    Camera((0.5, 2, 4), (0, 0.3, 0)),
    ambient=(0.2, 0.2, 0.3),
    implicits=[LEFT, RIGHT],
    room=((-4, 0, -4), (4, 3, 4)),
)


@snippet(box=((-0.5,) * 3, (0.5,) * 3))
def pearl(radius: float = 0.4):  # type: ignore[no-untyped-def]
    """fn pearl(p: vec3f, radius: f32) -> f32 { return length(p) - radius; }"""


@snippet(box=((-0.5,) * 3, (0.5,) * 3))
def wrong():  # type: ignore[no-untyped-def]
    """fn wrong(p: vec3f) -> f32 { return p; }"""


def told(*implicits: Implicit) -> Scene:
    return SCENE.with_(implicits=implicits)


def pictured(gpu: Gpu, scene: Scene, *changes: Callable[[Renderer], object], **more: Any) -> np.ndarray:
    """The light of a new renderer's first frame."""
    with Renderer(scene, SIZE, gpu=gpu, **(QUIET | more)) as renderer:
        for change in changes:
            change(renderer)
        renderer.draw()
        return renderer.radiance()


@contextmanager
def held() -> Iterator[None]:
    """Nothing is ready inside the block."""
    gate, ready = threading.Event(), Renderer._ready

    def later(*given: Any) -> Renderer:
        assert gate.wait(60)
        return ready(*given)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Renderer, "_ready", later)
        try:
            yield
        finally:
            gate.set()


def drawn(renderer: Renderer) -> np.ndarray:
    renderer.draw()
    return renderer.radiance()


def test_the_old_picture_stays_until_the_new_one_is_ready(gpu: Gpu) -> None:
    before = gpu.ledger.by_owner()
    with Renderer(SCENE, SIZE, gpu=gpu, **QUIET) as renderer:
        old = drawn(renderer)
        held_before = renderer.memory()
        with held():
            renderer.reshape("right", torus(0.4, 0.15), material=RED)
            for _ in range(3):
                np.testing.assert_array_equal(drawn(renderer), old)
                assert renderer.pending
            assert renderer.scene.implicits == (LEFT, RIGHT)
        renderer.settle()
        assert not renderer.pending
        new = Implicit(torus(0.4, 0.15), RIGHT.transform, RED, "right")
        known = len(gpu._programs)
        now = drawn(renderer)
        assert len(gpu._programs) == known, "all that a frame needs was compiled before"
        np.testing.assert_array_equal(now, pictured(gpu, told(LEFT, new)))
        assert np.abs(now - old).max() > 0.1
        assert renderer.scene.implicits[1].material is RED
        assert renderer.memory().keys() == held_before.keys()
        assert renderer.memory()["frame"] == held_before["frame"], "what it had before is freed"
    left = {owner: size for owner, size in gpu.ledger.by_owner().items() if owner != "constants"}
    assert left == {owner: size for owner, size in before.items() if owner != "constants"}


def test_the_same_kinds_compile_nothing(gpu: Gpu) -> None:
    """In whatever order, with whatever numbers and materials; and kinds that were there a while ago."""
    with Renderer(SCENE, SIZE, gpu=gpu, **QUIET) as renderer:
        renderer.draw()
        known = set(gpu._programs)
        for change in (
            lambda: renderer.reshape("right", sphere(0.2) | sphere(0.3).at(0.3)),
            lambda: renderer.reshape("left", union(box(0.3), sphere(0.6).named("bead"), smooth=0.2)),
            lambda: renderer.reshape("left", material=RED),
        ):
            change()
            renderer.settle()
            renderer.draw()
            assert set(gpu._programs) == known
        ours = drawn(renderer)
        np.testing.assert_array_equal(ours, pictured(gpu, renderer.scene))
        renderer.reshape("right", torus(0.4, 0.15))
        renderer.settle()
        known = set(gpu._programs)
        renderer.reshape("right", sphere(0.2))
        renderer.settle()
        renderer.draw()
        assert set(gpu._programs) == known


def test_pipelines_of_long_ago_are_let_go(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tyndall.frame._REMEMBERED", 1)
    with Renderer(told(LEFT), SIZE, gpu=gpu, **QUIET) as renderer:
        renderer.draw()
        for shape in (sphere(0.3), box(0.3)):
            before = renderer._known
            renderer.reshape("left", shape)
            renderer.settle()
            renderer.draw()
            now = renderer._known
            assert [sum(slot in key[3] for key in gpu._programs) > 0 for slot in (*before, *now)] == [
                *(False for _ in before),
                True,
            ]


def test_a_snippet_is_added_by_name_and_removed(gpu: Gpu) -> None:
    with Renderer(SCENE, SIZE, gpu=gpu, **QUIET) as renderer:
        old = drawn(renderer)
        renderer.add(Implicit(pearl(), at(0, 1.2, 0), RED, "pearl"))
        renderer.settle()
        np.testing.assert_array_equal(drawn(renderer), pictured(gpu, renderer.scene))
        assert set(np.unique(renderer.surface("ids"))) == {0, 1, 2, 3}
        renderer.place("pearl", at(0, 0.5, 1))
        assert np.abs(drawn(renderer) - old).max() > 0.1
        renderer.remove("pearl")
        renderer.settle()
        np.testing.assert_array_equal(drawn(renderer), old)


def test_what_is_wrong_keeps_the_old_picture(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    with Renderer(SCENE, SIZE, gpu=gpu, **QUIET) as renderer:
        old = drawn(renderer)
        for message, change in {
            "the types of 'return'|return": lambda: renderer.reshape("right", wrong()),
            "Circle is no solid shape": lambda: renderer.reshape("right", circle(0.3)),
            "did you mean 'right'": lambda: renderer.reshape("rihgt", sphere()),
            "no object ''": lambda: renderer.remove(""),
            "2 implicit surfaces, and no 2": lambda: renderer.remove(2),
            "neither a shape nor a material": lambda: renderer.reshape("right"),
            "implicits.0.: Sphere is not Implicit": lambda: renderer.replace([sphere()]),  # type: ignore[list-item]
        }.items():
            with pytest.raises((ParameterError, SnippetError), match=message) as error:
                change()
            assert "\n" not in str(error.value)
            assert not renderer.pending
        renderer.use("occlusion", "field_ao")
        with pytest.raises(Unsupported, match="this scene has none"):
            renderer.replace([])
        renderer.use("occlusion", "none")

        def full(*_: Any, **__: Any) -> Fields:
            raise GpuError("field: no memory left")

        for wait in (True, False):
            with monkeypatch.context() as patch:
                patch.setattr("tyndall.frame.Fields", full)
                renderer.reshape("right", box(0.3))
                assert renderer._change is not None
                renderer._change.ready.exception()
            with pytest.raises(GpuError, match="no memory left"):
                renderer.settle() if wait else renderer.draw()
            assert not renderer.pending
            np.testing.assert_array_equal(drawn(renderer), old)
        renderer.reshape("right", box(0.3))
        renderer.settle()
        np.testing.assert_array_equal(drawn(renderer), pictured(gpu, renderer.scene))


def test_what_was_moved_stays_where_it_is(gpu: Gpu) -> None:
    """Also what is moved while another object's shape is being prepared, and also where objects get other numbers."""
    shape = union(*(sphere(0.2).at(0.3 * i).named("bead") for i in range(3)))
    beads = Implicit(shape, at(0, 1.2, 0), name="beads")
    turn = at(0.2, 0.3, 0) @ np.diag([0.8, 0.8, 0.8, 1])
    moves: tuple[Callable[[Renderer], object], ...] = (
        lambda r: r.place("beads", at(-0.5, 1.3, 0.2)),
        lambda r: r.move("bead", [np.eye(4), turn, turn, turn]),
        lambda r: r.edit("bead", radius=0.3),
    )
    with Renderer(told(LEFT, RIGHT, beads), SIZE, gpu=gpu, **QUIET) as renderer:
        renderer.draw()
        with held():
            for change in moves[:2]:
                change(renderer)
            renderer.draw()
            renderer.remove("right")
            renderer.draw()
            moves[2](renderer)
        renderer.settle()
        now = drawn(renderer)
        np.testing.assert_array_equal(now, pictured(gpu, told(LEFT, beads), *moves))
        renderer.draw()
        assert renderer.uploaded == 0
        renderer.reshape("beads", box(0.4))
        renderer.settle()
        there = Implicit(box(0.4), at(-0.5, 1.3, 0.2))
        rest: tuple[Callable[[Renderer], object], ...] = (
            lambda r: r.move("bead", [np.eye(4)]),
            lambda r: r.edit("bead", radius=0.3),
        )
        np.testing.assert_array_equal(drawn(renderer), pictured(gpu, told(LEFT, there), *rest))


def test_motion_goes_on_with_what_is_there(gpu: Gpu) -> None:
    """What was removed is passed over; what came is moved with the rest; another motion may come with it."""

    def motion(time: float) -> dict[str, Any]:
        return {"left": [(0, time, 0)], "right": [(0, 0, time)]}

    with Renderer(SCENE.with_(motion=motion), SIZE, gpu=gpu, **QUIET) as renderer:
        renderer.draw(time=0.5)
        renderer.remove("right")
        renderer.reshape("left", box(0.4))
        renderer.settle()
        renderer.draw(time=0.5)
        np.testing.assert_array_equal(
            renderer.radiance(), pictured(gpu, told(Implicit(box(0.4), at(-0.9, 1.0, 0), name="left")))
        )
        renderer.replace([RIGHT], motion=lambda time: {"right": [(time, 0, 0)]})
        renderer.settle()
        renderer.draw(time=0.5)
        np.testing.assert_array_equal(renderer.radiance(), pictured(gpu, told(Implicit(RIGHT.shape, at(1.4, 0.5, 0)))))


def test_the_last_of_what_is_asked_for_is_drawn(gpu: Gpu) -> None:
    with Renderer(SCENE, SIZE, gpu=gpu, **QUIET) as renderer:
        renderer.draw()
        with held():
            for radius in (0.2, 0.3, 0.4, 0.6):
                renderer.reshape("left", sphere(radius))
            renderer.remove(1)
        renderer.settle()
        np.testing.assert_array_equal(drawn(renderer), pictured(gpu, told(Implicit(sphere(0.6), LEFT.transform))))
    with Renderer(SCENE, SIZE, gpu=gpu, **QUIET) as renderer:
        with held():
            renderer.remove(0)
        renderer.draw()  # and closed while it is being prepared


def test_from_nothing_to_light_and_back(gpu: Gpu) -> None:
    """A scene gets its first implicit surface, one that shines, and loses it; clouds stay."""
    cloud = Volume(sphere(0.5), Medium(0.5), at(0, 1, 1))
    scene = told().with_(volumes=[cloud])
    lamp = Implicit(sphere(0.4), at(0, 1, 0), Material(emissive=(3, 2, 1)))
    with Renderer(scene, SIZE, gpu=gpu, **QUIET) as renderer:
        renderer.dim(0.5)
        old = drawn(renderer)
        renderer.add(lamp)
        renderer.settle()
        expected = pictured(gpu, scene.with_(implicits=[lamp]), lambda r: r.dim(0.5))
        np.testing.assert_array_equal(drawn(renderer), expected)
        assert renderer.surface("emissive").any()
        renderer.remove(0)
        renderer.settle()
        np.testing.assert_array_equal(drawn(renderer), old)


def test_rays_meet_the_new_shapes_with_the_tree_they_had(gpu: Gpu) -> None:
    """And techniques may be exchanged while something is being prepared."""
    with Renderer(SCENE, SIZE, gpu=gpu, **(QUIET | {"shadow": "ray_traced"})) as renderer:
        renderer.draw()
        tree = renderer.world
        renderer.reshape("right", box(0.5))
        renderer.settle()
        np.testing.assert_array_equal(drawn(renderer), pictured(gpu, renderer.scene, shadow="ray_traced"))
        assert renderer.world is tree
        for name in ("shadow_map", "ray_traced"):
            technique = QUIET["shadow"] if name == "shadow_map" else FAMILIES["shadow"].make(name)
            with held():
                renderer.reshape("right", sphere(0.3) if name == "shadow_map" else box(0.3))
                renderer.use("shadow", technique)
            renderer.settle()
            assert renderer.technique("shadow") is technique
            np.testing.assert_array_equal(drawn(renderer), pictured(gpu, renderer.scene, shadow=technique))
