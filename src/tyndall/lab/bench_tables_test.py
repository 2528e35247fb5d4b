"""Tables say what was measured, beside what S1 published."""

from __future__ import annotations

from typing import Any

import pytest

from tyndall.lab import bench_tables


def row(technique: str, scene: str, median: float) -> dict[str, Any]:
    times = {"median": median, "min": median, "p95": median}
    return {
        "scene": scene,
        "triangles": 607402,
        "technique": technique,
        "gpu_ms": times,
        "frame_ms": {"median": 4 * median + 1, "min": 1, "p95": 9},
        "host_ms": times,
        "memory_bytes": 32 << 20,
        "shadow_bytes": 4 << 20,
    }


@pytest.fixture
def document() -> dict[str, Any]:
    lights = [{"lights": n, **row("froxel", "box", 0.1 * n)} for n in (1, 2)]
    fit = {"intercept": 0.0, "slope": 0.1, "r2": 0.9987}
    return {
        "adapter": "Test GPU",
        "adapter_type": "DiscreteGPU",
        "driver": "1.2 (Vulkan)",
        "date": "2026-01-02",
        "versions": {"tyndall": "0.1.0", "python": "3.12.1", "wgpu": "0.32.0"},
        "settings": {
            "size": [2134, 1459],
            "shadow_size": 1024,
            "grid": [190, 90, 128],
            "samples": 64,
            "frames": 200,
            "warmup": 60,
        },
        "scenes": [
            row("froxel", "box", 0.1),
            row("froxel", "blinds", 0.125),
            row("screen_space", "box", 0.3),
            row("polygonal", "box", 2.0),
            row("off", "box", 0.0),
        ],
        "lights": {"froxel": {"rows": lights, "time_fit": fit, "memory_fit": fit | {"slope": 4 << 20}}},
        "resolution": {
            "box": {
                "reference": {"steps": 1024, "change_on_doubling": 0.0005, "converged": True},
                "sweeps": {
                    "polygonal": [
                        {
                            "resolution": 512,
                            **row("polygonal", "box", 1.5),
                            "error": {"rel_rmse": 0.02, "bias": -0.01},
                            "against_finest": {"rel_rmse": 0.05, "bias": 0.0},
                        }
                    ]
                },
            }
        },
    }


def test_s1_milliseconds_follow_from_its_frame_rates() -> None:
    assert bench_tables.s1_milliseconds("box", "froxel") == pytest.approx(0.943, abs=1e-3)
    assert bench_tables.s1_milliseconds("courtyard", "polygonal") == pytest.approx(7.673, abs=1e-3)
    assert bench_tables.s1_milliseconds("box", "off") is None
    assert bench_tables.s1_milliseconds("box", "march") is None


def test_every_table_is_rectangular(document: dict[str, Any]) -> None:
    blocks = [block for block in bench_tables.markdown(document).split("\n\n") if block.startswith("|")]
    assert len(blocks) == 6
    for block in blocks:
        assert len({line.count("|") for line in block.splitlines()}) == 1
        assert len(block.splitlines()) >= 3


def test_tables_hold_the_figures(document: dict[str, Any]) -> None:
    text = bench_tables.markdown(document)
    assert "| blinds (607,402) | froxel | 0.125 | 0.125 | 0.125 | 1.500 | 667 | 0.125 | 0.93 | 94 |" in text
    assert "| froxel | 0.100 | 0.200 | 0.100 | 0.9987 |" in text
    assert "| froxel | 36.00 | 36.00 | 4.00 | 0.9987 |" in text
    assert "| polygonal | 512 | 1.500 | 32.00 | 2.00 % | -1.00 % | 5.00 % |" in text
    assert "Slowest scene over fastest: froxel 1.25." in text


def test_goals_are_held_against_the_worst(document: dict[str, Any]) -> None:
    text = bench_tables.markdown(document)
    assert "| froxel, GPU time | 0.125 ms | 0.15 ms | yes |" in text
    assert "| screen space, GPU time | 0.300 ms | 0.25 ms | **no** |" in text
    assert "| polygonal, memory with its shadow map | 36.000 MiB | 8 MiB | **no** |" in text
    document["adapter_type"] = "CPU"
    assert "### Goals" not in bench_tables.markdown(document)


def test_a_page_keeps_its_prose() -> None:
    page = "Before.\n\n<!-- gpu -->\nold\n<!-- /gpu -->\n\nAfter.\n"
    once = bench_tables.splice(page, "gpu", "new\n")
    assert once == "Before.\n\n<!-- gpu -->\n\nnew\n\n<!-- /gpu -->\n\nAfter.\n"
    assert bench_tables.splice(once, "gpu", "new\n") == once
    with pytest.raises(ValueError, match="no place 'cpu'"):
        bench_tables.splice(page, "cpu", "")


def test_a_comparison_is_a_table_of_its_results() -> None:
    times = {"median": 0.5, "min": 0.4, "p95": 0.6}
    error = {"rel_rmse": 0.0321, "psnr": None, "bias": -0.01}
    result = {"technique": "froxel", "model": "paper", "gpu_ms": times, "frame_ms": 2.0, "memory_bytes": 1 << 20}
    text = bench_tables.comparison(
        {
            "scene": "box",
            "triangles": 4968,
            "size": [64, 36],
            "adapter": "Test GPU",
            "reference": {"technique": "march", "steps": 1024, "change_on_doubling": 0.0006, "converged": True},
            "results": [{**result, "error": error}, {**result, "model": None, "error": None}],
        }
    )
    assert "| froxel (paper) | 0.500 | 0.400 | 0.600 | 1.00 | 3.21 % | -1.00 % | – |" in text
    assert "| froxel | 0.500 | 0.400 | 0.600 | 1.00 | – | – | – |" in text


def test_an_unfinished_run_has_the_tables_it_can(document: dict[str, Any]) -> None:
    del document["lights"], document["resolution"]
    text = bench_tables.markdown(document)
    assert "### Memory" in text
    assert "### Lights" not in text


def test_a_reference_that_did_not_converge_is_named(document: dict[str, Any]) -> None:
    document["resolution"]["box"]["reference"]["converged"] = False
    assert "1024 steps (not converged)" in bench_tables.markdown(document)
