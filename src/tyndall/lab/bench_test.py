"""The benchmark, run in very small."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tyndall.gpu.device import Gpu
from tyndall.lab import bench
from tyndall.lab.picture import OutputError

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
    assert 0.9 < heard[-1] <= 1
    document = json.loads((tmp_path / "out" / "volumetric.json").read_text())
    assert document == json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert (tmp_path / "out" / "volumetric.md").read_text() == found.markdown()

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
    coarse, fine = (row["error"]["rel_rmse"] for row in sweeps["froxel"])
    assert fine < coarse
    few, many = (row["error"]["rel_rmse"] for row in sweeps["march"])
    assert many < few
    smaller, finest = sweeps["polygonal"]
    assert finest["against_finest"] == finest["error"]
    assert smaller["against_finest"]["rel_rmse"] > 0


def test_a_place_that_cannot_be_written_is_found_first(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="is a file"):
        bench.volumetric("an adapter that is never asked for", tmp_path / "out")
