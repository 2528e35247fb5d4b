"""A comparison of real techniques on a small picture: its figures, its document, its folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError
from tyndall.lab import stage
from tyndall.lab.bench import QUICK, volumetric
from tyndall.lab.compare import Comparison, compare
from tyndall.lab.fingerprint import scene_hash
from tyndall.lab.picture import OutputError
from tyndall.lab.render import render
from tyndall.scene.bundled.box import box
from tyndall.scene.model import Medium, Scene
from tyndall.techniques.volumetric import Froxel

SIZE = (64, 36)
SHADOW = {"shadow_map": {"size": 256}}
SMALL = {**SHADOW, "froxel": {"grid": (32, 18, 32)}}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return box()


@pytest.fixture(scope="module")
def comparison(gpu: Gpu, scene: Scene) -> Comparison:
    heard: list[float] = []
    found = compare(
        scene,
        size=SIZE,
        volumetric=["off", "froxel", "march"],
        model="both",
        parameters=SMALL,
        frames=3,
        warmup=1,
        adapter=gpu,
        progress=lambda fraction, _: heard.append(fraction),
    )
    assert heard == sorted(heard)
    assert heard[-1] == 1
    return found


def test_the_reference_has_converged_and_says_how(comparison: Comparison) -> None:
    document = comparison.to_json()["reference"]
    assert document["technique"] == "march"
    assert document["converged"]
    assert document["change_on_doubling"] < 1e-3
    assert document["mean"] > 0


def test_no_light_at_all_is_missing_entirely(comparison: Comparison) -> None:
    off = comparison["off"]
    assert off.error is not None
    assert off.error.bias == pytest.approx(-1)
    assert off.error.rel_rmse >= 1
    assert not off.still.light.any()
    assert off.memory_bytes <= 16  # an empty uniform


def test_light_that_is_there_is_nearer_to_the_truth(comparison: Comparison) -> None:
    errors = {label: comparison[label].error for label in ("off", "froxel", "march")}
    assert all(error is not None for error in errors.values())
    assert errors["march"].rel_rmse < errors["froxel"].rel_rmse < 0.6
    assert errors["froxel"].psnr > errors["off"].psnr


def test_each_model_has_its_row_and_its_files_name(comparison: Comparison) -> None:
    rows = [(r.technique, r.model, r.label) for r in comparison.results]
    assert rows == [
        ("off", None, "off"),
        ("froxel", "physical", "froxel"),
        ("froxel", "paper", "froxel-paper"),
        ("march", None, "march"),
    ]
    assert "same physical reference" in str(comparison)


def test_times_and_bytes_are_the_techniques_own(comparison: Comparison) -> None:
    froxel = comparison["froxel"].measurement
    assert froxel.frames == 3
    assert froxel.memory["volumetric.froxel"] == comparison["froxel"].memory_bytes >= 2 * 8 * 32 * 18 * 32
    own = sum(times.median for name, times in froxel.passes.items() if name.startswith("volumetric.froxel."))
    assert own == pytest.approx(froxel.technique("volumetric").median, rel=0.5)
    assert 0 < froxel.technique("volumetric").median < froxel.frame.median
    assert "volumetric.froxel" not in comparison["march"].measurement.memory


def test_the_document_has_the_promised_fields(comparison: Comparison, scene: Scene) -> None:
    document = json.loads(json.dumps(comparison.to_json(), allow_nan=False))
    assert set(document) == {
        *("adapter", "scene", "triangles", "size", "results"),
        *("reference", "versions", "driver", "parameters", "scene_hash"),
    }
    assert (document["scene"], document["triangles"], document["size"]) == ("box", 4968, list(SIZE))
    assert document["scene_hash"] == scene_hash(scene)
    for result in document["results"]:
        assert list(result) == ["technique", "model", "gpu_ms", "frame_ms", "memory_bytes", "error", "image"]
        assert set(result["gpu_ms"]) == {"median", "min", "p95"}
        assert set(result["error"]) == {"rel_rmse", "psnr", "bias"}
        assert result["image"] is None
    assert document["parameters"]["volumetric"]["froxel"]["grid"] == [32, 18, 32]
    assert document["parameters"]["shadow"] == {**document["parameters"]["shadow"], "size": 256}


def test_the_folder_is_whole_and_other_files_stay(comparison: Comparison, tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "out"
    folder.mkdir(parents=True)
    (folder / "notes.txt").write_text("mine")
    (folder / "results.json").write_text("old")
    comparison.save(folder)
    labels = ("off", "froxel", "froxel-paper", "march")
    expected = {f"{label}{end}" for label in labels for end in (".png", ".exr", "-closeup.png")}
    expected |= {"reference.png", "reference.exr", "results.json", "notes.txt"}
    assert {path.name for path in folder.iterdir()} == expected
    assert [path.name for path in folder.parent.iterdir()] == ["out"]
    assert (folder / "notes.txt").read_text() == "mine"
    document = json.loads((folder / "results.json").read_text())
    for result in document["results"]:
        with Image.open(folder / result["image"]) as image:
            assert image.size == SIZE
    assert comparison.to_json()["results"][0]["image"] == str(folder / "off.png")


def test_an_interrupted_save_leaves_nothing(
    comparison: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tyndall.lab.compare.strip", interrupt)
    with pytest.raises(KeyboardInterrupt):
        comparison.save(tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_folders_place_is_found_before_any_work(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="is a file"):
        compare(scene, out=tmp_path / "out" / "deeper", adapter="no such adapter is asked for")


def test_notebooks_get_table_and_pictures(comparison: Comparison) -> None:
    html = comparison._repr_html_()
    assert html.count("<img") == len(comparison.results) + 1
    assert "froxel" in html


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"volumetric": ["froxle"]}, "froxel"),
        ({"volumetric": ["froxel"], "model": "best"}, "model: 'best'"),
        ({"frames": 0}, "frames: 0"),
        ({"warmup": -1}, "warmup: -1"),
        ({"volumetric": ["off"], "reference": "off"}, "no number of steps"),
        ({"shadow": "nope"}, "shadow technique 'nope'"),
        ({"volumetric": [Froxel]}, "Froxel'> is neither a volumetric technique nor the name of one"),
        ({"parameters": {"froxle": {"grid": (8, 8, 8)}}}, "parameters: no technique 'froxle' — did you mean 'froxel'?"),
    ],
)
def test_mistakes_get_one_line(gpu: Gpu, scene: Scene, arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError) as error:
        compare(scene, size=SIZE, adapter=gpu, **arguments)  # type: ignore[arg-type]
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_one_technique_twice_has_two_rows_and_files(gpu: Gpu, scene: Scene, tmp_path: Path) -> None:
    twice = [Froxel(grid=(n, n, n)) for n in (4, 8)]
    options = {"size": (16, 9), "reference": None, "frames": 1, "warmup": 0, "adapter": gpu, "parameters": SHADOW}
    found = compare(scene, volumetric=twice, out=tmp_path, **options)  # type: ignore[arg-type]
    assert [result.label for result in found.results] == ["froxel", "froxel-2"]
    assert {path.name for path in tmp_path.glob("*.png")} == {"froxel.png", "froxel-2.png"}
    assert found.to_json()["parameters"]["volumetric"]["froxel-2"]["grid"] == (8, 8, 8)
    alone = compare(scene, volumetric="off", **options)  # type: ignore[arg-type]
    assert [result.technique for result in alone.results] == ["off"]


def test_an_adapter_without_timers_gives_no_times(gpu: Gpu, scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu, "_timed", False)
    found = compare(
        scene, size=(16, 9), volumetric=["froxel"], reference=None, frames=1, warmup=0, adapter=gpu, parameters=SMALL
    )
    (result,) = found.to_json()["results"]
    assert result["gpu_ms"] is None
    assert result["frame_ms"] is None
    assert result["memory_bytes"] > 0
    assert "timestamp-query" in str(found)
    with pytest.raises(GpuError, match="cannot time what it draws"):
        volumetric(gpu, settings=replace(QUICK, size=(16, 9), shadow_size=64))


def test_the_path_of_a_scene_is_no_scene() -> None:
    for function in (render, compare):
        with pytest.raises(ParameterError, match="^scene: 'room.json' is no Scene; tyndall.load reads one"):
            function("room.json")  # type: ignore[operator]


def test_a_vacuum_has_no_relative_error(gpu: Gpu, scene: Scene) -> None:
    vacuum = scene.with_(medium=Medium())
    found = compare(vacuum, size=(32, 18), volumetric=["froxel"], frames=1, warmup=0, adapter=gpu, parameters=SMALL)
    assert found.to_json()["results"][0]["error"] is None
    assert "–" in str(found)


def test_a_picture_is_the_same_twice(gpu: Gpu, scene: Scene) -> None:
    first, second = (
        render(scene, size=SIZE, frames=2, adapter=gpu, parameters=SMALL, seed=3, volumetric="march") for _ in range(2)
    )
    assert np.array_equal(first.pixels, second.pixels)
    assert np.array_equal(first.radiance, second.radiance)
    assert first.metadata["technique"] == "march"


def test_a_technique_starts_from_the_scenes_looks(scene: Scene) -> None:
    assert stage.make("volumetric", "froxel", scene).z_limit == scene.looks["froxel"]["z_limit"]
    changed = stage.make("volumetric", "froxel", scene, {"froxel": {"z_limit": 3}})
    assert changed.z_limit == 3


def test_everything_is_freed(gpu: Gpu, scene: Scene) -> None:
    before = gpu.ledger.total
    compare(scene, size=(16, 9), volumetric=["froxel"], frames=1, warmup=0, adapter=gpu, parameters=SMALL)
    assert gpu.ledger.total == before
