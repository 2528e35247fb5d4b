"""The tables hold the figures of the document, say what they mean, and name what is missing."""

from __future__ import annotations

import copy
import re
from typing import Any

import pytest

from tyndall.gpu.params import ParameterError
from tyndall.lab import s5
from tyndall.lab.bench_sdf import join
from tyndall.lab.bench_sdf_tables import absent, failures, markdown, parts_of


def times(ms: float) -> dict[str, float]:
    return {"median": ms, "min": ms, "p95": ms}


def state(gpu_ms: float, host_ms: float, fps: float) -> dict[str, Any]:
    passes = {"implicit.prune": 0.3 * gpu_ms, "gbuffer.field_march": 0.6 * gpu_ms, "lighting": 0.01, "composite": 0.02}
    return {"frame_ms": times(gpu_ms), "host_ms": times(host_ms), "passes": passes, "fps": fps, "frames": 9}


def ours(still_ms: float, moving_ms: float, host_ms: float) -> dict[str, Any]:
    return {
        "still": state(still_ms, 1.0, 1000 / still_ms),
        "moving": state(moving_ms, host_ms, 1000 / max(moving_ms, host_ms)),
        "memory": {"frame": 2**20, "implicit": 3 * 2**20},
        "uploaded_still": 0,
        "uploaded_moving": 1216,
    }


LATE = {"failed": "no picture within 30 s", "timeout_s": 30}


@pytest.fixture
def document() -> dict[str, Any]:
    facts = {"scene_hash": "0" * 64, "objects": 4, "nodes": 1124, "lights": 1}
    array = {
        "fragment": {"frame_ms": times(6236.0), "measured_size": [480, 270]},
        "compute": {"frame_ms": times(162.0)},
    }
    reason = "GpuError: the driver said that it is out of memory | and gave up"
    return {
        "benchmark": "sdf",
        "date": "2026-11-25",
        "adapter": "A card",
        "adapter_type": "DiscreteGPU",
        "driver": "1.2",
        "versions": {"tyndall": "0.1.0", "wgpu": "0.32.0", "python": "3.12.3"},
        "settings": {"size": [1920, 1080], "seconds": 2.0, "loop_seconds": 1.0, "frame": {"shadow": "field cones=1"}},
        "scenes": [
            {"scene": "snail", **facts, "ours": ours(4.0, 6.0, 3.5), "loop": {"fragment": LATE, "compute": LATE}},
            {
                "scene": "jumper",
                **facts,
                "ours": ours(2.0, 3.0, 5.0),
                "loop": {"fragment": LATE, "compute": {"frame_ms": times(7.0), "compile_ms": 21_400.0}},
            },
            {"scene": "temple", **facts, "ours": {"failed": reason}},
        ],
        "swarm": [
            {"scene": "swarm:1000", "count": 1000, **facts, "ours": ours(2.5, 4.0, 1.0), "listed": array},
            {
                "scene": "swarm:10000",
                "count": 10_000,
                **facts,
                "ours": ours(9.0, 20.0, 3.0),
                "loop": {"fragment": {"failed": "not tried: 10,000 as code"}},
                "listed": {"compute": {"frame_ms": times(6637.0), "measured_size": [480, 270]}},
            },
        ],
        "edits": {
            "scene": "swarm:10000",
            **facts,
            "rows": {
                "nothing": {"edit_ms": times(0.0), "draw_ms": times(2.0), "frame_ms": times(9.0), "uploaded": 0},
                "all leaves": {"edit_ms": times(1.16), "draw_ms": times(2.0), "uploaded": 1_199_872},
            },
        },
        "first": [
            {
                "scene": "swarm:1000",
                **facts,
                "new": {"failed": "no picture within 90 s"},
                "kept": {"first_ms": 1200.0, "link_ms": 200.0, "process_ms": 2500.0},
                "running": {"first_ms": 178.0, "warm_ms": 20.0},
            }
        ],
        "agreement": [
            {
                "scene": "snail",
                **facts,
                "cells": {"entries": 5000, "overflows": 0},
                "still": {"points": 10**6, "near": 6 * 10**5, "difference": 0.0, "excess": 0.0, "flipped": 0},
                "moved": {"points": 10**6, "near": 6 * 10**5, "difference": 2e-6, "excess": 0.0, "flipped": 1},
            }
        ],
    }  # fmt: skip


def row(text: str, begin: str, title: str = "") -> list[str]:
    """The cells of the table row that begins so, after a title."""
    found = re.search(rf"^\| {re.escape(begin)} \|(.*)\|$", text[text.index(title) :], re.MULTILINE)
    assert found, begin
    return [cell.strip() for cell in found[1].split(" | ")]


def test_scenes_stand_beside_the_loop_and_s5(document: dict[str, Any]) -> None:
    text = markdown(document)
    theirs = [str(fps) for fps in s5.FPS["snail"]]
    assert row(text, "`snail`", "### Scenes") == [
        "1,124",
        "4",
        "250",
        "**167**",
        "4.00",
        "6.00",
        "1.00",
        "3.50",
        *theirs,
    ]
    begin = "GPU time of our whole frame"
    late = "no picture within 30 s"
    assert row(text, "`snail`", begin) == ["4.00", late, late, "–", "–", "–"]
    assert row(text, "`jumper`", begin) == ["2.00", late, "7.00 (21.4 s)", "–", "3.5×", "3.5×"]
    assert (
        "- `snail`, moving, 167: 6.00 ms on the GPU, of which `gbuffer.field_march` 3.60, `implicit.prune` 1.80" in text
    )
    assert "- `jumper`, moving, 200: waits for the host, 5.00 ms a frame; the GPU takes 3.00" in text
    assert "- `jumper`, still" not in text
    assert row(text, "`implicit.prune`") == ["1.80", "0.900"]
    assert row(text, "2 more") == ["0.030", "0.030"]
    assert row(text, "`snail`", "Memory on the device") == ["3.0", "4.0", "0", "1,216"]


def test_swarms_stand_beside_both_loops(document: dict[str, Any]) -> None:
    text = markdown(document)
    begin = "Beside the plain loop"
    assert row(text, "1,000", begin) == ["2.50", "4.00", "–", "–", "6,236*", "162", "64.8×", "40.5×"]
    assert row(text, "10,000", begin)[2:] == ["not tried: 10,000 as code", "–", "–", "6,637*", "737.4×", "331.9×"]
    assert "a star marks a time of a picture of 480×270" in text
    assert row(text, "10,000", "### Swarm") == ["1,124", "111", "**50**", "9.00", "20.00", "1.00", "3.00"]


def test_goals_that_nobody_measured_are_not_met(document: dict[str, Any]) -> None:
    text = markdown(document)
    unknown = "**not known**"
    assert row(text, "`snail` over the plain loop") == ["no picture within 30 s", "≥ 1.5×", unknown]
    assert row(text, "`jumper` over the plain loop (compute)") == ["3.5×", "≥ 1.5×", "yes"]
    assert row(text, "`temple` over the plain loop") == ["ours was not measured", "≥ 1.5×", unknown]
    assert row(text, "`temple`, still, frames a second") == ["not measured", "≥ 240", unknown]
    assert row(text, "`snail`, moving, frames a second") == ["167", "≥ 240", "**no**"]
    assert row(text, "10,000 moving primitives, frames a second") == ["50", "≥ 60", "**no**"]
    assert row(text, "move all leaves, host") == ["1.160 ms", "≤ 1 ms", "**no**"]
    assert row(text, "first picture of `swarm:1000`: a new process, nothing kept")[2] == unknown
    assert row(text, "`snail`, still: pruned and whole values at 1,000,000 points")[::2] == [
        "equal in every bit",
        "yes",
    ]
    assert row(text, "`snail`, moved: pruned and whole values at 1,000,000 points")[2] == "**no**"
    assert "### Goals" not in markdown({**document, "adapter_type": "CPU"})


def test_what_failed_or_is_not_there_is_named_with_its_reason(document: dict[str, Any]) -> None:
    text = markdown(document)
    assert row(text, "`temple`", "### Scenes")[2:4] == ["failed, see the end", "–"]
    assert row(text, "`temple`", "### Not measured") == [
        "GpuError: the driver said that it is out of memory \\| and gave up"
    ]
    assert row(text, "the plain loop in `snail` as code, compute") == ["no picture within 30 s"]
    assert row(text, "wgpu-shadertoy") == ["not in this run"]
    assert row(text, "`swarm:1000`", "### First")[2:] == ["no picture within 90 s", "–", "–", "–"]
    only = {
        key: document[key] for key in ("benchmark", "date", "adapter", "adapter_type", "driver", "versions", "settings")
    }
    assert len(list(absent(only))) == 7
    edits = {**only, "edits": {"scene": "swarm:10000", "failed": "GpuError: lost"}}
    assert row(markdown(edits), "edits of `swarm:10000`") == ["GpuError: lost"]
    first = {**only, "first": [{"scene": "nowhere", "failed": "ParameterError: no scene"}], "scenes": []}
    assert "| `nowhere` | – | a new process, nothing kept | ParameterError: no scene |" in markdown(first)
    for table in re.findall(r"(?:^\|.*\n)+", text + markdown(first), re.MULTILINE):
        assert len({line.replace("\\|", "").count("|") for line in table.splitlines()}) == 1, table


def test_documents_of_several_runs_are_joined(document: dict[str, Any]) -> None:
    head = {key: document[key] for key in ("benchmark", "adapter", "adapter_type", "driver", "versions")}
    settings = {**document["settings"], "seconds": 30.0}
    found = {"compute": {"frame_ms": times(12.0), "compile_ms": 60_000.0}}
    later: dict[str, Any] = {
        **head,
        "date": "2026-11-26",
        "settings": settings,
        "scenes": [
            {"scene": "snail", "scene_hash": "0" * 64, "loop": found},
            {"scene": "temple", "scene_hash": "0" * 64, "ours": ours(3.0, 3.5, 1.0)},
            {"scene": "jumper", "scene_hash": "1" * 64, "loop": found},
        ],
        "first": [{"scene": "temple", "nodes": 9, "running": {"first_ms": 99.0}}],
        "peer": {"failed": "not installed"},
    }
    whole = join([document, later])
    rows = {row["scene"]: row for row in whole["scenes"]}
    assert list(rows) == ["snail", "jumper", "temple"]
    assert rows["snail"]["loop"] == {"fragment": LATE, **found}
    assert rows["snail"]["ours"] == document["scenes"][0]["ours"]
    assert "ours" not in rows["jumper"]  # figures of what is another scene by now are gone
    assert [row["scene"] for row in whole["first"]] == ["swarm:1000", "temple"]
    assert parts_of(whole) == ["scenes", "swarm", "edits", "first", "agreement", "loops", "peer"]
    assert "`temple`" not in dict(failures(whole))  # what a later run measured is no failure
    assert {"what": "wgpu-shadertoy", "reason": "not installed"} in whole["failed"]
    text = markdown(whole)
    assert "2026-11-25 to 2026-11-26" in text
    assert "medians over 2 to 30 s of frames" in text
    assert (
        "2 runs: ours in the scenes, ours in the swarms, edits, first pictures, pruned and whole values, the plain"
        in text
    )
    again = join([whole, {**later, "scenes": [], "first": []}])
    assert len(again["runs"]) == 3
    assert again["scenes"] == whole["scenes"]
    for key, value, match in (
        ("adapter", "Another", "not of one adapter"),
        ("benchmark", "shadows", "not all of this benchmark"),
        ("settings", {**settings, "size": [160, 90]}, "not of pictures of one size"),
    ):
        with pytest.raises(ParameterError, match=match):
            join([document, {**copy.deepcopy(later), key: value}])
    with pytest.raises(ParameterError, match="not all of this benchmark"):
        join([])
