"""The statistics of a measurement, on a renderer whose times are known."""

from __future__ import annotations

import time

import pytest

from tyndall.lab.measure import Times, measure


class Scripted:
    """Frame ``i`` spends ``i`` ms in one pass and 2 ms in another; the first frames are far slower."""

    def __init__(self, slow_frames: int = 0, seconds: float = 0.0) -> None:
        self.frame = 0
        self.slow_frames = slow_frames
        self.seconds = seconds

    def draw(self) -> float:
        self.frame += 1
        time.sleep(self.seconds)
        return 0.5

    def timings(self) -> dict[str, float]:
        index = self.frame - self.slow_frames
        scatter = 1000.0 if index <= 0 else float(index)
        return {
            "lighting": 1.0,
            "volumetric.froxel.scatter": scatter,
            "volumetric.froxel.accumulate": 2.0,
            "frame": scatter + 4,
        }

    def memory(self) -> dict[str, int]:
        return {"volumetric.froxel": 100, "volumetric_other": 7, "shadow.shadow_map": 30}


def test_median_minimum_and_percentile() -> None:
    times = Times.of([4.0, 1.0, 2.0, 3.0, 100.0])
    assert (times.median, times.min) == (3.0, 1.0)
    assert times.p95 == pytest.approx(4 + 0.8 * 96)
    with pytest.raises(ValueError, match="no frames"):
        Times.of([])


def test_a_technique_is_the_sum_of_its_passes_frame_by_frame() -> None:
    found = measure(Scripted(slow_frames=4), frames=9, warmup=4)
    assert found.frames == 9
    assert found.technique("volumetric").to_json() == {"median": 7.0, "min": 3.0, "p95": pytest.approx(10.6)}
    assert found.passes["volumetric.froxel.scatter"].median == 5.0
    assert found.frame.median == 9.0
    assert found.host.median == 0.5
    assert found.bytes_of("volumetric") == 100
    assert found.technique("tonemap") == Times(0, 0, 0)


def test_warm_up_frames_are_not_measured() -> None:
    assert measure(Scripted(slow_frames=3), frames=2, warmup=3).frame.p95 < 1000
    assert measure(Scripted(slow_frames=3), frames=2, warmup=2).frame.p95 > 500


def test_a_slow_adapter_stays_in_its_budget() -> None:
    heard: list[float] = []
    start = time.monotonic()
    found = measure(Scripted(seconds=0.02), frames=10_000, warmup=1000, budget_s=0.3, progress=heard.append)
    assert time.monotonic() - start < 2
    assert 2 <= found.frames < 100
    assert heard == sorted(heard)
    assert heard[-1] <= 1


def test_no_frames_is_a_clear_mistake() -> None:
    with pytest.raises(ValueError, match="frames: 0"):
        measure(Scripted(), frames=0)
