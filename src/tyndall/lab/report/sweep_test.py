"""A sweep's page: every row is on it, once, at its place."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from tyndall.lab.picture import OutputError
from tyndall.lab.report import write_report
from tyndall.lab.report.sweep import dimensions, measures, read_rows


def row(id: str, technique: dict[str, Any], lights: int = 1, ms: float | None = 1.0, **more: Any) -> dict[str, Any]:
    """A line of results.jsonl."""
    point = {
        "scene": "/some/where/box.json",
        "lights": lights,
        "size": [96, 54],
        "technique": technique,
        "shadow": {"technique": "shadow_map", "size": 1024},
        "frames": 4,
        "truth": {"judge": "traced"},
    }
    scores = {"rel_rmse_corrected": 0.0, "rel_rmse": 0.3, "within_noise": True, "rel_rmse_limit": 0.07, "flip": 0.2}
    return {
        "id": id,
        "status": "done",
        "reason": None,
        "point": point,
        "gpu_ms": {"median": ms, "min": ms, "p95": ms} if ms else None,
        "memory_bytes": 3 * 2**20,
        "errors": {"inscattered": scores},
        "truth": {"judge": "traced"},
        "adapter": "a <device>",
        "driver": "a driver",
        "versions": {"tyndall": "0.1.0"},
        **more,
    }


ROWS = [
    row("a", {"technique": "froxel", "grid": [64, 36, 32]}, ms=0.2),
    row("b", {"technique": "froxel", "grid": [8, 8, 8]}, ms=0.1),
    row("c", {"technique": "march", "steps": 64}, lights=4, ms=3.0),
    row("d", {"technique": "march", "steps": 64}, lights=2, ms=None),
    row("e", {"technique": "off"}, status="failed", reason="the <worker> died"),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    lines = [json.dumps(r) for r in (row("a", {"technique": "off"}), *ROWS)]
    (tmp_path / "sweep").mkdir()
    (tmp_path / "sweep/results.jsonl").write_text("\n".join([*lines, "no row", '{"id": "cut'] + [""]), encoding="utf-8")
    return tmp_path / "sweep"


def test_the_later_row_of_a_point_counts_and_broken_lines_do_not(folder: Path) -> None:
    assert read_rows(folder) == (ROWS, 0)


def test_rows_that_are_not_of_the_present_points_are_left_out(folder: Path) -> None:
    (folder / "points.json").write_text('["d", "z", "b"]')
    assert read_rows(folder) == ([ROWS[3], ROWS[1]], 3)
    text = write_report(folder).read_text(encoding="utf-8")
    assert "3 rows of results.jsonl are not of this specification" in text
    (folder / "points.json").write_text('["z"]')
    with pytest.raises(OutputError, match=r"results\.jsonl: holds no rows of this sweep"):
        write_report(folder)
    (folder / "points.json").write_text("7")
    with pytest.raises(OutputError, match=r"points\.json: is not a list of points"):
        write_report(folder)


def test_a_line_ends_where_the_line_ends(folder: Path) -> None:
    odd = row("a", {"technique": "off"}, scene_name="a\u2028b\x85c")
    (folder / "results.jsonl").write_text(json.dumps(odd, ensure_ascii=False) + "\n", encoding="utf-8", newline="\n")
    assert read_rows(folder) == ([odd], 0)


@pytest.mark.parametrize(
    ("more", "line"),
    [
        ({"gpu_ms": {"median": float("nan")}}, "point x: gpu_ms.median: nan is not a number"),
        ({"memory_bytes": float("inf")}, "point x: memory_bytes: inf is not a number"),
        ({"errors": {"radiance": "good"}}, "point x: errors.radiance: 'good' is not a number"),
        ({"errors": {"radiance": {"flip": "good"}}}, "point x: errors.radiance.flip: 'good' is not a number"),
    ],
)
def test_a_figure_that_is_no_number_is_one_line(tmp_path: Path, more: dict[str, Any], line: str) -> None:
    odd = {**row("x", {"technique": "off"}), **more}
    (tmp_path / "results.jsonl").write_text(json.dumps(odd) + "\n")
    with pytest.raises(OutputError, match=re.escape(line)):
        write_report(tmp_path)


def test_what_varies_is_found_in_its_order() -> None:
    found = {d.name: d for d in dimensions(ROWS[:4])}
    assert set(found) == {"lights", "technique", "froxel.grid", "variant"}
    assert found["lights"].numbers == [1, 2, 4]
    assert found["lights"].places == [0, 0, 2, 1]
    assert found["froxel.grid"].values == ["8×8×8", "64×36×32"], "by size"
    assert found["froxel.grid"].places == [1, 0, None, None]
    assert found["variant"].values == ["froxel 64×36×32", "froxel 8×8×8", "march"]


def test_measures_have_a_value_a_row_and_say_what_noise_hides() -> None:
    found = {m.name: m for m in measures(ROWS[:4])}
    assert found["GPU time of the technique"].values == [0.2, 0.1, 3.0, None]
    assert found["memory of the technique"].values == [3.0] * 4
    corrected = found["rel. RMSE, corrected, light in the air"]
    assert corrected.values == pytest.approx([7.0] * 4)
    assert corrected.hidden == [0, 1, 2, 3]
    assert found["FLIP, light in the air"].hidden == []


def test_the_page_has_every_point_and_every_failure(folder: Path) -> None:
    text = write_report(folder).read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" class="data">(.*?)</script>', text, re.DOTALL)
    assert found
    plain = json.loads(found[1])
    assert all(len(m["values"]) == 4 for m in plain["measures"])
    assert text.count("<tr><td") == 4 + 1
    assert "5 points over lights (3), technique (2) and froxel.grid (2)." in text
    assert "the &lt;worker&gt; died" in text
    assert "a &lt;device&gt;" in text
    assert "box.json" in text
    assert "/some/where" not in text


def test_a_sweep_of_one_point_has_a_page(tmp_path: Path) -> None:
    (tmp_path / "results.jsonl").write_text(json.dumps(ROWS[0]) + "\n")
    assert "One point." in write_report(tmp_path).read_text(encoding="utf-8")


def test_a_sweep_whose_points_all_failed_has_a_page(tmp_path: Path) -> None:
    (tmp_path / "results.jsonl").write_text(json.dumps(ROWS[4]) + "\n")
    assert "the &lt;worker&gt; died" in write_report(tmp_path).read_text(encoding="utf-8")


@pytest.mark.parametrize("content", ["", "[]\n", "{}\n", "nothing"])
def test_a_file_without_rows_is_one_line(tmp_path: Path, content: str) -> None:
    (tmp_path / "results.jsonl").write_text(content)
    with pytest.raises(OutputError, match=r"results\.jsonl: holds no rows of a sweep"):
        write_report(tmp_path)
