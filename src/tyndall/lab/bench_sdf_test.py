"""The benchmark of implicit surfaces measures what it says, and keeps going where something fails."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.lab import bench_sdf, bench_sdf_tables, first_picture
from tyndall.lab.bench_sdf import SdfBench, Settings, frames_per_second, sdf
from tyndall.lab.first_picture import Order, in_a_process, run
from tyndall.scene.model import Camera, DirectionalLight, Implicit, Scene
from tyndall.sdf import box, sphere, union

TINY = Settings(
    size=(24, 16),
    scenes=("snail",),
    swarm=(10,),
    edited=10,
    first=("swarm:10",),
    agreement=("swarm:10",),
    points=500,
    seconds=0.2,
    loop_seconds=0.2,
    frames=2,
    warmup=1,
    edits=2,
    processes=False,
)


def made(name: str) -> Scene:
    """A scene of that name, small."""
    rng = np.random.default_rng(1)
    count = 4 if name.startswith("swarm") else 3
    leaves = [sphere(0.2).at(*rng.uniform(-0.6, 0.6, 3)).named("swarm") for _ in range(count)]

    def motion(time: float) -> Mapping[str, ArrayLike]:
        return {"swarm": np.full((count, 3), 0.1 * np.sin(time))}

    return Scene(
        lights=(DirectionalLight((-0.3, -1, -0.2)),),
        camera=Camera((0, 1, 3), (0, 0, 0)),
        implicits=(Implicit(union(*leaves, smooth=0.05)), Implicit(box((4, 0.1, 4)).at(0, -1))),
        motion=motion,
        name=name.partition(":")[0],
    )


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Scene]:
    monkeypatch.setattr(bench_sdf, "open_scene", made)
    monkeypatch.setattr(first_picture, "open_scene", made)
    monkeypatch.setattr("tyndall.lab.baseline.FEWEST", 4)
    return made


def test_everything_is_measured(gpu: Gpu, small: object, tmp_path: Path) -> None:
    said: list[float] = []
    bench = sdf(gpu, tmp_path, settings=TINY, progress=lambda fraction, text: said.append(fraction))
    document = bench.to_json()
    assert "failed" not in document
    assert said == sorted(said)
    assert said[-1] <= 1
    scene, swarm = document["scenes"][0], document["swarm"][0]
    for row in (scene, swarm):
        for state in ("still", "moving"):
            figures = row["ours"][state]
            assert figures["frame_ms"]["median"] > 0
            assert figures["host_ms"]["median"] > 0
            assert figures["fps"] > 0
            assert "gbuffer.field_march" in figures["passes"]
        assert row["loop"]["fragment"]["frame_ms"]["median"] > 0
        assert row["loop"]["compute"]["compile_ms"] > 0
    assert scene["objects"] == 2
    assert scene["nodes"] == 3 * 3 + 1 + 2
    assert len(scene["scene_hash"]) == 64
    assert swarm["listed"]["compute"]["frame_ms"]["median"] > 0
    assert swarm["ours"]["uploaded_moving"] > swarm["ours"]["uploaded_still"]
    rows = document["edits"]["rows"]
    assert set(rows) == {"nothing", "a leaf", "the object", "all leaves", "the scene's own motion"}
    assert rows["a leaf"]["uploaded"] > rows["nothing"]["uploaded"]
    assert document["first"][0]["running"]["warm_ms"] > 0
    parts = document["first"][0]["running"]
    assert parts["setup_ms"] + parts["record_ms"] <= parts["first_ms"] + 0.01
    assert parts["link_ms"] + parts["modules_ms"] + parts["pipelines_ms"] >= max(parts["slowest"].values(), default=0)
    agreed = document["agreement"][0]
    assert agreed["still"]["points"] == 500
    assert max(agreed["still"]["difference"], agreed["moved"]["difference"]) < 1e-4
    text = bench.markdown()
    for title in ("Scenes", "Swarm", "Edits", "First picture", "Pruned and whole values"):
        assert f"### {title}" in text
    assert json.loads((tmp_path / "sdf.json").read_text(encoding="utf-8")) == document
    assert (tmp_path / "sdf.md").read_text(encoding="utf-8") == text
    assert "| wgpu-shadertoy | not in this run |" in text
    goals = bench_sdf_tables.markdown({**document, "adapter_type": "DiscreteGPU"})
    assert "`snail` over the plain loop" in goals
    assert "10,000 moving" not in goals


def test_what_fails_is_told_and_the_rest_goes_on(gpu: Gpu, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(name: str) -> Scene:
        raise ParameterError(f"no scene '{name}'")

    monkeypatch.setattr(bench_sdf, "open_scene", broken)
    found = sdf(gpu, tmp_path, settings=dataclasses.replace(TINY, parts=("scenes", "edits", "agreement"))).to_json()
    assert [row["what"] for row in found["failed"]] == ["snail", "swarm:10", "swarm:10"]
    assert found["scenes"] == [{"scene": "snail", "ours": {"failed": "ParameterError: no scene 'snail'"}}]
    text = SdfBench(found).markdown()
    assert "| `snail` | ParameterError: no scene 'snail' |" in text
    assert "| the plain loops | not in this run |" in text
    with pytest.raises(ParameterError, match="no part 'scene' — did you mean 'scenes'"):
        sdf(gpu, settings=dataclasses.replace(TINY, parts=("scene",)))


def test_a_slow_loop_is_measured_smaller(gpu: Gpu, small: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_picture, "SLOW_MS", 0.0)
    found = run(Order("snail", "compute", size=(32, 16), seconds=0.1, frames=2), gpu)
    assert found["measured_size"] == [8, 4]
    assert "*" in bench_sdf_tables._loop(found)


def test_a_process_of_its_own_draws_and_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """A scene's name is all that the other process gets; one is told what went wrong, or that it was late."""
    assert "no scene 'nowhere'" in in_a_process(Order("nowhere", size=(8, 6)), keep_compiled=False)["failed"]
    assert in_a_process(Order("nowhere"), timeout=0.01)["failed"] == "no picture within 0.01 s"
    assert "–" in bench_sdf_tables._loop(None)


def test_frames_are_counted_with_what_the_host_does() -> None:
    calls: list[str] = []
    fps = frames_per_second(lambda: calls.append("draw"), lambda: calls.append("wait"), 0.0, 1000)
    assert fps > 0
    assert calls == ["draw"] * bench_sdf.BATCH + ["wait"]
