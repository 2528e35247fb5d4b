"""The tables hold the figures of the document, and say what they mean."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from tyndall.lab import s4
from tyndall.lab.bench_shadows_tables import markdown


def times(ms: float) -> dict[str, float]:
    return {"median": ms, "min": ms, "p95": ms}


def cell(technique: str, triangles: int, lights: int, frame_ms: float, wall_ms: float = 3.0) -> dict[str, Any]:
    return {
        "technique": technique,
        "triangles": triangles,
        "lights": lights,
        "frame_ms": times(frame_ms),
        "shadow_ms": times(0.25 * lights),
        "host_ms": times(1.5),
        "wall_ms": times(wall_ms),
        "memory_bytes": lights * 2**22,
        "passes": lights,
    }


def error(technique: str, radius: float, rmse: float, equal: float | None = None) -> dict[str, Any]:
    row = {
        "technique": technique,
        "scene": "shadows",
        "radius": radius,
        "rel_rmse": rmse,
        "boundary": 2 * rmse,
        "bias": -rmse,
        "frame_ms": times(1.0),
        "shadow_ms": times(0.5),
        "noise": 0.01 if radius else 0.0,
    }
    return row if equal is None else {**row, "equal": equal, "equal_off_edges": equal + 0.0001}


def situation(technique: str, name: str, right: float) -> dict[str, Any]:
    return {"technique": technique, "situation": name, "kind": "lights", "right": right, "rel_rmse": 1 - right}


def described(lines: int) -> dict[str, Any]:
    return {"parameters": {}, "count": 3, "lines": {"host": lines, "shader": 10, "below": 0}, "paper": ""}


@pytest.fixture
def document() -> dict[str, Any]:
    labels = ("shadow_map", "projective", "shadow_volume/zpass", "shadow_volume/zfail", "pcf")
    every = [(n, count) for n in (10, 100_000) for count in (1, 5)]
    cells = [cell(label, n, count, 0.1 * count) for label in labels for n, count in every]
    cells[3]["frame_ms"] = times(1000 / 112 / 1.5)  # shadow_map, 100,000 triangles, 5 lights: 1.5 times S4's
    return {
        "benchmark": "shadows",
        "date": "2031-01-02",
        "adapter": "Some GPU",
        "adapter_type": "DiscreteGPU",
        "driver": "1.2 (Vulkan)",
        "versions": {"tyndall": "9.9", "python": "3.13", "wgpu": "0.32"},
        "settings": {
            "size": [800, 600], "error_size": [640, 360], "frames": 50, "warmup": 8, "frame": {"tonemap": "aces"},
        },
        "techniques": {label: described(50 * i + 50) for i, label in enumerate(labels)},
        "cells": cells,
        "light_cost": {
            "shadow_map": {
                "triangles": 100_000,
                "shadow": {"slope": 0.05, "intercept": 0, "r2": 1},
                "frame": {"slope": 0.123, "intercept": 0, "r2": 0.99},
            }
        },
        "silhouettes": [{"technique": "shadow_volume/zpass", "triangles": 1_000_000, "silhouettes_ms": 0.21}],
        "errors": [
            error("shadow_map", 0.5, 0.08),
            error("pcf", 0.5, 0.06),
            error("shadow_map", 0.0, 0.02, 0.98),
            error("shadow_volume/zfail", 0.0, 0.001, 0.9995),
        ],
        "shrink": [
            {"technique": label, "radius": radius, "rel_rmse": e, "to_hard": h, "truth_to_hard": radius / 5}
            for label, radius, e, h in (
                ("pcf", 0.0, 0.01, 0.011),
                ("shadow_map", 0.0, 0.02, 0.021),
                ("pcf", 0.5, 0.06, 0.09),
                ("shadow_map", 0.5, 0.08, 0.022),
                ("pcf", 0.1, 0.03, 0.04),
            )
        ],
        "resolution": [
            {"technique": "shadow_map", "texels": n, "rel_rmse": 10 / n, "shadow_ms": times(n / 1e4)}
            for n in (256, 4096)
        ],
        "situations": [
            situation("shadow_map", "point", 0.997),
            situation("shadow_volume/zpass", "inside", 0.1),
            situation("shadow_volume/zfail", "inside", 1.0),
            situation("projective", "directional", 0.999),
        ],
        "refused": [
            {
                "part": "situations", "technique": "projective", "situation": "curved", "kind": "receivers",
                "reason": "no plane",
            },
        ],
        "peer": {
            "version": "0.17",
            "map_size": 1024,
            "cells": [
                {"triangles": 10, "lights": 1, "wall_ms": times(9.0)},
                {"triangles": 100_000, "lights": 5, "wall_ms": times(2.0)},
            ],
        },
    }  # fmt: skip


def line(text: str, *begin: str) -> str:
    """The one line of a table that begins so."""
    (found,) = [row for row in text.splitlines() if row.startswith("| " + " | ".join(begin))]
    return found


def section(text: str, title: str) -> str:
    return text.partition(f"### {title}\n")[2].partition("\n### ")[0]


def test_s4s_cells_stand_beside_ours(document: dict[str, Any]) -> None:
    text = section(markdown(document), "S4's tables")
    maps, perspective, volumes = text.split("\n\n**")[1:]
    assert maps.startswith("Shadow maps**, here `shadow_map`")
    assert line(maps, "10 |").split(" | ")[1] == "10,000 (730; 13.7×)"
    assert line(maps, "100,000").endswith("| **168 (112; 1.5×)** |"), "less than twice S4's is bold"
    assert perspective.startswith("Perspective shadows**, here `projective`")
    assert "shadow_volume/zpass" in volumes
    assert "zfail" not in text, "S4 counts by z-pass"


def test_goals_are_held_against_the_worst(document: dict[str, Any]) -> None:
    text = section(markdown(document), "Goals")
    assert "1.50× (100,000 triangles, 5 lights); 1 missed | ≥ 2× | **no**" in line(text, "`shadow_map`, frames/s")
    assert line(text, "`projective`, frames/s").endswith("| yes |")
    assert "0.123 ms (R² 0.99) | ≤ 0.1 ms | **no**" in line(text, "each light of `shadow_map`")
    assert "0.250 ms | ≤ 0.1 ms | **no**" in line(text, "map of one light")
    assert "0.210 ms | ≤ 0.3 ms | yes" in line(text, "silhouettes of 1,000,000")
    assert "99.96 % | ≥ 99.90 % | yes" in line(text, "z-fail equals")
    assert "0.67 times as fast; 1 missed | faster | **no**" in line(text, "`pcf`, whole frame")
    document["adapter_type"] = "CPU"
    assert "### Goals" not in markdown(document), "the goals are a GPU's"


def test_the_peer_stands_beside_the_map_with_pcf_first(document: dict[str, Any]) -> None:
    text = section(markdown(document), "Beside pygfx")
    first, second = text.split("With `shadow_map`:")
    assert line(first, "10 |") == "| 10 | 3.000 / 9.000 | – |"
    assert line(second, "100,000") == "| 100,000 | – | **3.000 / 2.000** |"
    document["peer"] = {"failed": "it is not installed"}
    assert "Not measured: it is not installed" in markdown(document)


def test_errors_are_ordered_and_shown_beside_the_times(document: dict[str, Any]) -> None:
    text = section(markdown(document), "Error against truth")
    soft, hard = text.split("lit by a point.")
    assert soft.index("`pcf`") < soft.index("`shadow_map`")
    assert hard.index("zfail") < hard.index("`shadow_map`")
    assert "equal" not in soft.partition("| technique")[2]
    row = line(section(markdown(document), "Every technique in S4's cells"), "`shadow_map`", "10 ")
    assert row.endswith("| 20.00 | 2.00 % | 8.00 % |")


def test_only_what_follows_the_light_is_shown_shrinking(document: dict[str, Any]) -> None:
    text = section(markdown(document), "As the light shrinks")
    assert "shadow_map" not in text
    assert "| against its own truth | 0.5 m | 0.1 m | 0 m |" in text
    assert "| `pcf` | 9.00 % | 4.00 % | 1.10 % |" in text
    assert "| *truth* | 10.00 % | 2.00 % | 0.00 % |" in text


def test_every_claim_has_its_figure(document: dict[str, Any]) -> None:
    text = section(markdown(document), "S4's comparison")
    claims = text.partition("What S4 says")[2]
    assert "error 3.91 %, 0.026 ms, 4096²: error 0.24 %, 0.410 ms | yes" in line(claims, "`shadow_map`", "quality")
    assert line(claims, "`shadow_map`", "for spot").endswith("| no |")
    assert line(claims, "`shadow_map`", "more objects").endswith("1.00 times as long as 10, with one light | yes |")
    assert "refuses" in line(claims, "`projective`", "only")
    assert "zpass` at worst 10.00 %" in line(claims, "`shadow_volume`", "usable")
    assert line(claims, "all three").endswith("| no |"), "100 lines of projective are more than 60 of the map's"
    row = line(text, "`shadow_volume/zpass`")
    assert row.startswith("| `shadow_volume/zpass` | 1 | 5 | 150 | 10 | 0 | 3 | 0 of 1 | 0.100 | 0.500 |")
    assert "| 1 of 2 |" in line(text, "`projective`", "1 "), "what it refuses it does not serve"


def test_a_part_of_a_document_is_enough(document: dict[str, Any]) -> None:
    head = ("benchmark", "date", "adapter", "adapter_type", "driver", "versions", "settings", "techniques")
    for part in ("cells", "errors", "shrink", "resolution", "situations", "silhouettes", "refused", "peer"):
        some = {name: copy.deepcopy(document[name]) for name in (*head, part)}
        text = markdown(some)
        assert "None" not in text.replace("None of S4's", "")
        assert text.count("### ") >= (part != "silhouettes")
    assert "no plane" in section(markdown(document), "Refused")


def test_s4s_numbers_fall_with_work() -> None:
    """What is copied from a paper is checked by what it must show: more triangles, or lights, never draw faster."""
    for name, rows in s4.FPS.items():
        assert len(rows) == len(s4.TRIANGLES)
        for row in rows:
            assert len(row) == len(s4.LIGHTS)
            assert sorted(row, reverse=True) == list(row), name
        # One cell of the volumes stands out in the thesis itself: 10,000 triangles under 3 lights.
        columns = [list(column) for column in zip(*rows, strict=True)]
        odd = [column for column in columns if sorted(column, reverse=True) != column]
        assert odd == ([[485, 455, 364, 482, 398]] if name == "shadow_volume" else [])
    assert s4.fps("shadow_volume/zfail", 10, 1) is None
    assert s4.fps("shadow_volume/zpass", 100_000, 5) == 75
