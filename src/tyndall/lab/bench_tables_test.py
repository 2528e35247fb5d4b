"""Tables say what was measured, beside what S1 published."""

from __future__ import annotations

from typing import Any

import pytest

from tyndall.lab import bench_tables, s1
from tyndall.scene import bundled


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
    assert s1.milliseconds("box", "froxel") == pytest.approx(0.943, abs=1e-3)
    assert s1.milliseconds("courtyard", "polygonal") == pytest.approx(7.673, abs=1e-3)
    assert s1.milliseconds("box", "off") is None
    assert s1.milliseconds("box", "march") is None


def test_the_bundled_scenes_are_those_of_s1() -> None:
    assert {name: bundled.TRIANGLES[name] for name in s1.SCENES} == {name: n for name, (_, n) in s1.SCENES.items()}
    for at, name in enumerate(s1.SCENES):
        scene = bundled.SCENES[name]()
        for technique, parameters in s1.VISUAL.items():
            own = {"light": scene.lights[0].intensity, **scene.looks[technique]}
            assert {p: values[at] for p, values in parameters.items()} == pytest.approx(own)


def test_every_table_is_rectangular(document: dict[str, Any]) -> None:
    blocks = [block for block in bench_tables.markdown(document).split("\n\n") if block.startswith("|")]
    assert len(blocks) == 10
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


def test_s1_s_numbers_stand_beside_ours(document: dict[str, Any]) -> None:
    document["scenes"][0] |= {"parameters": {"z_limit": 17.6}, "intensity": 10.0}
    text = bench_tables.markdown(document)
    assert "| blinds | 607,402 | Classroom | 607,402 |" in text
    assert "| froxels | 190×90×128 | 190×90×128 |" in text
    assert "| froxel | z_limit | 17.6 | 17.6 | – | 11 |" in text
    assert "| froxel | light, L_c | 10 | 10 | – | 50 |" in text
    assert "| box | 1000 | 714 | 455 | 111 | 156 | 136 | 119 | 116 |" in text
    assert text.count("another machine, RTX 4060 Laptop") == 2
    assert "![" not in text
    assert (
        "![Figure 22: memory of each technique against the number of lights](a/b-memory.svg)"
        in bench_tables.markdown(document, "a/b-")
    )


def test_the_plots_hold_the_figures(document: dict[str, Any]) -> None:
    found = bench_tables.plots(document)
    assert set(found) == {"time", "lights", "memory"}
    assert found == bench_tables.plots(document), "equal data, equal bytes"
    assert "box, froxel, Test GPU: 0.1 ms" in found["time"]
    assert "box, froxel, S1: another machine, RTX 4060 Laptop: 0.943 ms" in found["time"]
    assert "froxel: 0.2 ms" in found["lights"]
    assert "froxel: 36 MiB" in found["memory"]
    del document["lights"]
    assert set(bench_tables.plots(document)) == {"time"}


def test_errors_against_truth_are_a_table_over_the_scenes_and_one_a_scene(document: dict[str, Any]) -> None:
    light = {"rel_rmse_corrected": 3.0, "bias": -0.5, "scaled_rel_rmse": 0.25, "best_scale": 4.0}
    picture = {"rel_rmse_corrected": 0.125, "flip": 0.0625, "ssim": None}
    errors = {"inscattered": light, "radiance": picture}
    parameters = {"technique": "march", "steps": 2048}
    march = {"technique": "march", "parameters": parameters, "shadow": {"size": 4096}, "errors": errors}
    screen = {"technique": "screen_space", "parameters": {}, "shadow": {"size": 1024}, "errors": errors}
    truth = {"samples": 4096, "seconds": 7.25, "relative_error": {"inscattered": 0.0099, "radiance": 0.001}}
    document["truth"] = {
        "box": {"size": [640, 360], "truth": truth, "rows": [screen, march]},
        "blinds": {"size": [640, 360], "truth": truth, "rows": [march]},
        "courtyard": {"size": [640, 360], "truth": None, "rows": []},
    }
    text = bench_tables.markdown(document)
    assert "| rel. RMSE of `L_v` | box | blinds |" in text
    assert "| screen_space | 300.00 % | – |" in text
    assert "| march, 2048 steps, map of 4096² | 300.00 % | 300.00 % |" in text
    assert "| screen_space | 300.00 % | -50.00 % | 25.00 % | 4.000 | 12.50 % | 0.062 | – |" in text
    assert "**box**: truth of 4,096 samples a pixel, traced in 7.2 s; its own relative standard error is 0.99 %" in text


def test_what_could_not_be_measured_is_told(document: dict[str, Any]) -> None:
    document["failed"] = [{"point": "box, 32 lights, 2134×1459, march", "reason": "the worker died (signal 9)"}]
    assert "| box, 32 lights, 2134×1459, march | the worker died (signal 9) |" in bench_tables.markdown(document)


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


def test_a_comparison_against_a_traced_truth_shows_what_its_noise_hides() -> None:
    row = {"model": None, "gpu_ms": {"median": 0.5, "min": 0.4, "p95": 0.6}, "memory_bytes": 2**20}
    row["error"] = {"rel_rmse": 0.5, "bias": -0.25, "psnr": 30.0}
    clear = {"rel_rmse_corrected": 0.375, "rel_rmse_limit": 0.4, "within_noise": False, "boundary": 0.75}
    hidden = {"rel_rmse_corrected": 0.0, "rel_rmse_limit": 0.125, "within_noise": True, "boundary": None}
    document = {
        "scene": "box",
        "triangles": 4968,
        "size": [320, 180],
        "adapter": "Test GPU",
        "reference": {"judge": "traced", "samples": 64, "relative_error": {"inscattered": 0.0625, "radiance": 0.03}},
        "results": [
            {**row, "technique": "screen_space", "up_to_scale": True}
            | {"errors": {"inscattered": {**clear, "scaled_rel_rmse": 0.0625}}},
            {**row, "technique": "march", "up_to_scale": False, "errors": {"inscattered": hidden}},
        ],
    }
    text = bench_tables.comparison(document)
    assert "Truth: traced, 64 samples a pixel; its own standard error, 6.25 % of the inscattered light" in text
    assert "| screen_space | 0.500 | 0.400 | 0.600 | 1.00 | 37.50 % | -25.00 % | 30.0 | 75.00 % | 6.25 % |" in text
    assert "| march | 0.500 | 0.400 | 0.600 | 1.00 | < 12.50 % | -25.00 % | 30.0 | – | – |" in text


def test_a_reference_that_did_not_converge_is_named(document: dict[str, Any]) -> None:
    document["resolution"]["box"]["reference"]["converged"] = False
    assert "1024 steps (not converged)" in bench_tables.markdown(document)
