"""The benchmark, run in very small."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tyndall.gpu.device import Gpu, GpuError
from tyndall.lab import bench
from tyndall.lab.picture import OutputError
from tyndall.lab.sweep_point import Station

TINY = bench.Settings(
    size=(48, 27),
    shadow_size=128,
    grid=(16, 9, 16),
    samples=8,
    scenes=("box",),
    lights=(1, 2, 3),
    error_scenes=("box",),
    grids=((8, 5, 8), (48, 27, 64)),
    shadow_sizes=(64, 128),
    sample_counts=(8,),
    step_counts=(16, 128),
    truth_scenes=("box",),
    truth_size=(32, 18),
    truth_target=0.1,
    truth_steps=128,
    truth_shadow_sizes=(64, 128),
    frames=1,
    warmup=0,
)


def test_a_straight_line_is_found() -> None:
    found = bench.line([1, 2, 4], [5, 7, 11])
    assert found == {"intercept": pytest.approx(3), "slope": pytest.approx(2), "r2": pytest.approx(1)}
    flat = bench.line([1, 2, 4], [7, 7, 7])
    assert (flat["slope"], flat["r2"]) == (pytest.approx(0), 1)
    rng = np.random.default_rng(1)
    assert bench.line(range(50), rng.normal(size=50))["r2"] < 0.3


def test_everything_is_measured_and_written(gpu: Gpu, tmp_path: Path) -> None:
    heard: list[float] = []
    found = bench.volumetric(
        gpu, tmp_path / "out", settings=TINY, progress=lambda fraction, text: heard.append(fraction)
    )
    assert heard == sorted(heard)
    assert heard[-1] == 1
    document = json.loads((tmp_path / "out" / "volumetric.json").read_text())
    assert document == json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert (tmp_path / "out" / "volumetric.md").read_text() == found.markdown("volumetric-")
    assert "failed" not in document

    assert [row["technique"] for row in document["scenes"]] == list(bench.TECHNIQUES)
    froxel = document["scenes"][1]
    assert froxel["memory_bytes"] >= 2 * 8 * 16 * 9 * 16
    assert froxel["shadow_bytes"] >= 4 * 128 * 128
    assert froxel["host_ms"]["median"] > 0

    lights = document["lights"]
    assert [row["lights"] for row in lights["froxel"]["rows"]] == [1, 2, 3]
    one_map = 4 * 128 * 128
    assert lights["froxel"]["memory_fit"]["slope"] == pytest.approx(one_map, rel=0.1)
    assert lights["froxel"]["memory_fit"]["r2"] > 0.999

    sweeps = document["resolution"]["box"]["sweeps"]
    assert [row["resolution"] for row in sweeps["froxel"]] == [[8, 5, 8], [48, 27, 64]]
    coarse, fine = (row["error"]["rel_rmse"] for row in sweeps["froxel"])
    assert fine < coarse
    few, many = (row["error"]["rel_rmse"] for row in sweeps["march"])
    assert many < few
    smaller, finest = sweeps["polygonal"]
    assert finest["against_finest"] == finest["error"]
    assert smaller["against_finest"]["rel_rmse"] > smaller["error"]["rel_rmse"]

    truth = document["truth"]["box"]
    assert truth["truth"]["judge"] == "traced"
    errors = {(r["technique"], r["shadow"]["size"]): r["errors"]["inscattered"]["rel_rmse"] for r in truth["rows"]}
    assert errors["march", 64] > errors["march", 128], "a finer map is nearer to the truth"
    assert errors["off", 128] > errors["polygonal", 128]

    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert len(files) <= 9
    assert files >= {"results.jsonl", "spec.json", "points.json", "volumetric-time.svg", "volumetric-lights.svg"}

    begun = len((tmp_path / "out/results.jsonl").read_bytes().splitlines())
    again = bench.volumetric(gpu, tmp_path / "out", settings=TINY)
    assert again.to_json() == document, "nothing is measured twice"
    assert len((tmp_path / "out/results.jsonl").read_bytes().splitlines()) == begun


def test_a_point_that_failed_leaves_the_others(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    small = replace(TINY, lights=(), error_scenes=(), truth_scenes=(), size=(16, 9))
    measured = Station.measure

    def broken(self: Station, point: Mapping[str, Any], expected: str) -> dict[str, Any]:
        if point["technique"]["technique"] == "march":
            raise GpuError("this one is too large")
        return measured(self, point, expected)

    monkeypatch.setattr(Station, "measure", broken)
    document = bench.volumetric(gpu, settings=small).to_json()
    assert [row["technique"] for row in document["scenes"]] == list(bench.TECHNIQUES[:-1])
    assert document["failed"] == [{"point": "box, 1 light, 16×9, march", "reason": "this one is too large"}]


def test_an_adapter_without_timers_is_refused_before_anything_is_drawn(tmp_path: Path) -> None:
    class Untimed(Gpu):
        def __init__(self) -> None:
            self.features = frozenset()

    with pytest.raises(GpuError, match="cannot time"):
        bench.volumetric(Untimed(), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_place_that_cannot_be_written_is_found_first(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="is a file"):
        bench.volumetric("an adapter that is never asked for", tmp_path / "out")
