"""The shadow benchmark, run in very small, and its scenes."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError
from tyndall.lab import bench_shadows
from tyndall.lab.measure import wall_clock
from tyndall.lab.picture import OutputError
from tyndall.lab.shadow_situations import SITUATIONS
from tyndall.scene import bundled
from tyndall.scene.model import DirectionalLight, PointLight, Scene, SpotLight
from tyndall.techniques.contract import Unsupported
from tyndall.techniques.shadow import RayTraced, ShadowMap, ShadowVolume
from tyndall.tracing.world import World

TINY = bench_shadows.Settings(
    techniques=("shadow_map", "ray_traced"),
    size=(32, 24),
    triangles=(10, 100),
    lights=(1, 2),
    error_size=(48, 27),
    error_scenes=("shadows",),
    error_triangles=100,
    radii=(0.5, 0.1, 0.0),
    sizes=(32, 512),
    situations=("point", "inside"),
    situation_size=(48, 27),
    silhouettes=1000,
    target=0.1,
    truth_seconds=2.0,
    frames=1,
    warmup=1,
)


def test_everything_is_measured_kept_and_written(gpu: Gpu, tmp_path: Path) -> None:
    heard: list[float] = []
    found = bench_shadows.shadows(gpu, tmp_path / "out", settings=TINY, progress=lambda f, text: heard.append(f))
    assert heard == sorted(heard)
    assert heard[-1] == 1
    document = json.loads((tmp_path / "out/shadows.json").read_text())
    assert document == json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert (tmp_path / "out/shadows.md").read_text() == found.markdown()
    assert "failed" not in document

    cells = {(row["triangles"], row["lights"], row["technique"]): row for row in document["cells"]}
    assert set(cells) == {(t, n, name) for t in (10, 100) for n in (1, 2) for name in ("shadow_map", "ray_traced")}
    for (_, lights, name), row in cells.items():
        assert min(row[figure]["min"] for figure in ("wall_ms", "host_ms", "frame_ms")) > 0
        assert row["frame_ms"]["median"] >= row["shadow_ms"]["median"] > 0
        assert row["passes"] == (lights if name == "shadow_map" else 1)
    size = ShadowMap().size
    assert cells[10, 2, "shadow_map"]["memory_bytes"] >= 2 * 4 * size**2 > cells[10, 1, "shadow_map"]["memory_bytes"]

    hard = {row["technique"]: row for row in document["errors"] if row["radius"] == 0}
    soft = {row["technique"]: row for row in document["errors"] if row["radius"] == 0.5}
    assert hard["ray_traced"]["equal"] > 0.99
    assert hard["ray_traced"]["equal"] > hard["shadow_map"]["equal"]
    assert soft["ray_traced"]["rel_rmse"] < soft["shadow_map"]["rel_rmse"], "only one of them knows the light's size"
    assert "equal" not in soft["ray_traced"]

    shrunk: dict[str, dict[float, Any]] = {}
    for row in document["shrink"]:
        shrunk.setdefault(row["technique"], {})[row["radius"]] = row
    assert set(shrunk["shadow_map"]) == {0.5, 0.0}, "it does not follow the light's size"
    large, small, none = (shrunk["ray_traced"][radius]["to_hard"] for radius in TINY.radii)
    assert large > small > none
    truths = [shrunk["ray_traced"][radius]["truth_to_hard"] for radius in TINY.radii]
    assert truths == sorted(truths, reverse=True)
    assert truths[-1] == 0

    coarse, fine = document["resolution"]
    assert coarse["rel_rmse"] > fine["rel_rmse"]
    assert {row["situation"] for row in document["situations"]} == set(TINY.situations)
    assert document["silhouettes"] == []
    assert document["light_cost"]["shadow_map"]["triangles"] == 100
    hashes = {row["scene_hash"] for row in document["scenes"]}
    assert len(hashes) == len(document["scenes"]) == 4 + 3 + 2

    again = bench_shadows.shadows(gpu, tmp_path / "out", settings=TINY)
    assert again.to_json() == document, "nothing is measured twice"
    assert "were measured before" in again.notes[0]


def test_silhouettes_are_timed_alone(gpu: Gpu) -> None:
    small = replace(TINY, parts=("silhouettes",), techniques=("shadow_volume",))
    rows = bench_shadows.shadows(gpu, settings=small).to_json()["silhouettes"]
    assert [row["technique"] for row in rows] == ["shadow_volume/zpass", "shadow_volume/zfail"]
    for row in rows:
        assert 0 < row["silhouettes_ms"] < row["shadow_ms"]["median"]


def test_memory_is_all_that_a_technique_needs_and_nothing_of_others(gpu: Gpu) -> None:
    small = replace(TINY, parts=("cells",), triangles=(100,), lights=(1,))
    names = ("shadow_map", "shadow_volume/zpass", "shadow_volume/zfail", "ray_traced")
    together = bench_shadows.shadows(gpu, settings=replace(small, techniques=names)).to_json()["cells"]
    held = {row["technique"]: row["memory_bytes"] for row in together}
    for name in names[2:]:
        (alone,) = bench_shadows.shadows(gpu, settings=replace(small, techniques=(name,))).to_json()["cells"]
        assert alone["memory_bytes"] == held[name], "whatever was measured before"
    assert held["shadow_map"] >= 4 * ShadowMap().size ** 2
    scene = bench_shadows.counted(100)
    with World(gpu, scene) as world:
        tree = sum(resource.size_bytes for resource in world.resources() if resource.owner == "tracing")
    assert held["ray_traced"] > tree > 0
    # Three edges of three numbers or more for each triangle.
    assert held["shadow_volume/zpass"] > 36 * scene.triangle_count


def test_what_is_refused_or_fails_leaves_the_others(gpu: Gpu, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(self: Any, scene: Scene) -> None:
        raise Unsupported("two of them are too many")

    def fail(self: Any, *arguments: Any) -> Any:
        raise GpuError("this one is too large\n  and so on\n  by a byte\n")

    labels = ("shadow_volume/zpass", "ray_traced", "shadow_map")
    small = replace(TINY, parts=("cells",), triangles=(10,), lights=(1,), techniques=labels)
    with monkeypatch.context() as patch:
        patch.setattr(ShadowVolume, "supports", refuse)
        patch.setattr(RayTraced, "render", fail)
        document = bench_shadows.shadows(gpu, tmp_path, settings=small).to_json()
    where = {"part": "cells", "triangles": 10, "lights": 1}
    assert document["refused"] == [{**where, "technique": "shadow_volume/zpass", "reason": "two of them are too many"}]
    assert document["failed"] == [
        {**where, "technique": "ray_traced", "reason": "GpuError: this one is too large: by a byte"}
    ]
    assert [row["technique"] for row in document["cells"]] == ["shadow_map"]
    # A fault is tried again, a refusal stands.
    later = bench_shadows.shadows(gpu, tmp_path, settings=small).to_json()
    assert [row["technique"] for row in later["cells"]] == ["shadow_map", "ray_traced"]


def test_labels_are_names_or_ways() -> None:
    every = bench_shadows.choose()
    assert {label.partition("/")[0] for label in every} == set(bench_shadows.FAMILY.members)
    assert bench_shadows.choose(["shadow_volume"]) == ["shadow_volume/zpass", "shadow_volume/zfail"]
    assert bench_shadows.choose(["shadow_volume/zfail", "shadow_map"]) == ["shadow_map", "shadow_volume/zfail"]
    made: Any = bench_shadows.make("shadow_volume/zpass", Scene())
    assert made.method == "zpass"
    with pytest.raises(ParameterError, match="did you mean 'shadow_map'"):
        bench_shadows.choose(["shadow_mp"])


@pytest.mark.parametrize("change", [{"parts": ("cels",)}, {"techniques": ("shadow",)}])
def test_mistakes_are_found_first(change: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no (part|shadow technique)"):
        bench_shadows.shadows("an adapter that is never asked for", tmp_path / "out", settings=replace(TINY, **change))
    assert not (tmp_path / "out").exists()


def test_a_place_that_cannot_be_written_is_found_first(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="is a file"):
        bench_shadows.shadows("an adapter that is never asked for", tmp_path / "out")


def test_an_adapter_without_timers_is_refused() -> None:
    class Untimed(Gpu):
        def __init__(self) -> None:
            self.features = frozenset()

    with pytest.raises(GpuError, match="cannot time"):
        bench_shadows.shadows(Untimed())


def test_a_ball_gives_the_light_that_was_there() -> None:
    spot = SpotLight((1, 2, 3), (0, -1, 0), 7.0, (1, 0.5, 0.25))
    (ball,) = bench_shadows.lit_by_a_ball(Scene(lights=(spot, spot)), 0.5).lights
    assert ball == PointLight((1, 2, 3), 7.0, (1, 0.5, 0.25), 0.5)
    sun = DirectionalLight((0.0, -2.0, 0.0), 3.0)
    (far,) = bench_shadows.lit_by_a_ball(Scene(lights=(sun,)), 0.0).lights
    assert isinstance(far, PointLight)
    offset = np.array(far.position)
    assert far.intensity / (offset @ offset) == pytest.approx(3.0), "as bright in the middle of the scene"
    assert offset / np.linalg.norm(offset) == pytest.approx([0, 1, 0])


def test_a_pixel_is_right_on_its_side_and_equal_at_its_end() -> None:
    """One light of 1 over an ambient light of 0.25; the truth's albedo is a percent brighter than the frame's."""
    unlit, full = np.full((1, 6, 3), 0.25), np.full((1, 6, 3), 1.25)
    truth = 1.01 * np.array([1.25, 1.25, 1.25, 0.25, 0.25, 0.25])[None, :, None] * np.ones(3)
    light = np.array([1.25, 0.80, 0.70, 0.25, 0.253, 0.80])[None, :, None] * np.ones(3)
    equal, right = bench_shadows.agreement(light, truth, unlit, full)
    assert equal.tolist() == [[True, False, False, True, True, False]]
    assert right.tolist() == [[True, True, False, True, True, False]]
    # What the light cannot reach has nothing to be wrong about.
    equal, right = bench_shadows.agreement(unlit, truth, unlit, unlit)
    assert equal.all()
    assert right.all()


def test_the_ball_hangs_free_in_the_interior() -> None:
    """Light inside a surface is nobody's truth."""
    scene = bench_shadows.lit_by_a_ball(bundled.SCENES["interior"](), 0.5, bench_shadows._PLACES["interior"])
    (ball,) = scene.lights
    assert isinstance(ball, PointLight)
    rng = np.random.default_rng(3)
    nearest = math.inf
    for instance in scene.instances:
        matrix = np.asarray(instance.transform)
        corners = instance.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        weights = rng.dirichlet((1, 1, 1), (200, len(instance.mesh.indices)))
        points = np.einsum("stk,tkd->std", weights, corners[instance.mesh.indices])
        nearest = min(nearest, float(np.linalg.norm(points - ball.position, axis=-1).min()))
    assert nearest > ball.radius


@pytest.mark.parametrize("name", SITUATIONS)
def test_a_situation_shows_a_shadow(gpu: Gpu, name: str) -> None:
    """A scene in which nothing is in shadow could not tell techniques apart."""
    from tyndall.lab.stage import Stage

    with Stage(SITUATIONS[name].make(), (64, 36), adapter=gpu, volumetric="off", antialiasing="none") as stage:
        lit, free = stage.still(ShadowMap()).surfaces, stage.unshadowed().surfaces
    darker = (lit < 0.7 * free).any(axis=-1).mean()
    assert 0.005 < darker < 0.5


def test_the_clock_counts_drawing_and_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]

    def spend(seconds: float) -> Callable[[], None]:
        def work() -> None:
            now[0] += seconds

        return work

    monkeypatch.setattr("tyndall.lab.measure.time.perf_counter", lambda: now[0])
    monkeypatch.setattr("tyndall.lab.measure.time.monotonic", lambda: now[0])
    assert wall_clock(spend(0.25), spend(0.5), frames=3).median == pytest.approx(750)
    calls: list[int] = []
    wall_clock(lambda: calls.append(1), spend(1.0), frames=100, warmup=1, budget_s=0.5)
    assert len(calls) == 3, "a warm-up and the two frames that are measured whatever they take"
    with pytest.raises(ParameterError):
        wall_clock(spend(1), spend(1), frames=0)
