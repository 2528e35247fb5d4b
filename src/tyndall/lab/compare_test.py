"""A comparison of real techniques on a small picture: its figures, its document, its folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.lab import judging, metrics, stage
from tyndall.lab.compare import compare
from tyndall.lab.comparison import Comparison
from tyndall.lab.fingerprint import scene_hash
from tyndall.lab.measure import measure as real_measure
from tyndall.lab.picture import OutputError
from tyndall.lab.render import render
from tyndall.lab.stage import Stage
from tyndall.lab.truth import Truth, TruthSettings
from tyndall.scene.bundled.box import box
from tyndall.scene.model import Medium, Scene
from tyndall.techniques.shadow import RayTraced, ShadowMap
from tyndall.techniques.volumetric import Froxel, March

SIZE = (64, 36)
SHADOW = {"shadow_map": {"size": 256}}
GRID = {"froxel": {"grid": (32, 18, 32)}}
SMALL = {**SHADOW, **GRID}


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
        truth="march",
        frames=3,
        warmup=1,
        adapter=gpu,
        progress=lambda fraction, _: heard.append(fraction),
    )
    assert heard == sorted(heard)
    assert heard[-1] == 1
    return found


@pytest.fixture(scope="module")
def noisy(gpu: Gpu, scene: Scene) -> Truth:
    """The march's light with a known noise of a fifth of its mean."""
    with Stage(scene, SIZE, adapter=gpu, parameters=SHADOW) as where:
        still = where.still(March(steps=512, jitter=0))
    rng = np.random.default_rng(5)
    parts = {}
    for kind in ("inscattered", "radiance"):
        light = still.of(kind)
        error = np.full_like(light, 0.2 * light.mean())
        parts[kind], parts[f"{kind}_error"] = light + error * rng.standard_normal(light.shape, np.float32), error
    return Truth("noise", **parts, surfaces=None, depth=None, samples=64, seconds=1.5, size=SIZE, settings={"a": 1})


def test_the_march_has_converged_and_says_how(comparison: Comparison) -> None:
    document = comparison.to_json()["reference"]
    assert document["technique"] == document["judge"] == "march"
    assert document["relative_error"] == {"inscattered": 0, "radiance": 0}
    assert document["samples"] == document["steps"]
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
    assert "same physical truth" in str(comparison)


def test_every_metric_of_every_kind_of_light_is_there(comparison: Comparison) -> None:
    froxel, off = comparison["froxel"].scores, comparison["off"].scores
    assert set(froxel) == {"inscattered", "radiance"}
    for kind, scores in froxel.items():
        for name, value in scores.to_json().items():
            assert (value is None) == (name == "rel_rmse_limit"), f"{kind}: {name}"
        assert scores.ssim > off[kind].ssim
        assert scores.flip < off[kind].flip
        assert scores.boundary > scores.rel_rmse, "froxels blur the shafts' edges"
    # A bright wall dilutes the whole picture's error.
    assert froxel["radiance"].rel_rmse < froxel["inscattered"].rel_rmse
    shares = comparison.to_json()["reference"]["boundary_share"]
    assert all(0.01 < share < 0.5 for share in shares.values())


def test_only_what_is_right_up_to_a_scale_is_scaled(comparison: Comparison) -> None:
    assert [r.up_to_scale for r in comparison.results] == [False, False, True, False]
    lines = str(comparison).splitlines()
    (scaled,) = (line for line in lines if line.lstrip().startswith("scaled ×"))
    assert lines[lines.index(scaled) - 1].startswith("froxel*")
    paper = comparison["froxel-paper"].main
    assert paper is not None
    assert f"×{paper.best_scale:.3g}" in scaled
    assert scaled.split()[-1] == f"{100 * paper.scaled_rel_rmse:.0f}"
    assert paper.scaled_rel_rmse < paper.rel_rmse


def test_the_table_fits_80_columns(comparison: Comparison) -> None:
    from rich.console import Console

    text = StringIO()
    Console(width=80, file=text).print(comparison.table())
    lines = text.getvalue().splitlines()
    row = next(line for line in lines if line.startswith("froxel*"))
    assert len(row.split()) == 11, row
    assert not any("…" in line for line in lines)


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
        *("family", "exposure", "command"),
    }
    assert (document["scene"], document["triangles"], document["size"]) == ("box", 4968, list(SIZE))
    assert document["scene_hash"] == scene_hash(scene)
    for result in document["results"]:
        assert set(result) == {
            *("technique", "model", "gpu_ms", "frame_ms", "memory_bytes", "error", "image"),
            *("label", "up_to_scale", "host_ms", "passes", "memory", "errors", "exr", "still_exr"),
        }
        assert result["passes"]["frame"] == result["frame_ms"]
        assert result["host_ms"] > 0
        own = (size for owner, size in result["memory"].items() if owner.startswith("volumetric."))
        assert sum(own) == result["memory_bytes"]
        assert result["errors"]["inscattered"]["rel_rmse"] == pytest.approx(result["error"]["rel_rmse"], abs=1e-5)
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
    expected = {f"{label}{end}" for label in labels for end in (".png", ".exr", "-still.exr", "-closeup.png")}
    expected |= {"reference.png", "reference.exr", "results.json", "notes.txt"}
    assert {path.name for path in folder.iterdir()} == expected
    assert [path.name for path in folder.parent.iterdir()] == ["out"]
    assert (folder / "notes.txt").read_text() == "mine"
    document = json.loads((folder / "results.json").read_text())
    for result in document["results"]:
        with Image.open(folder / result["image"]) as image:
            assert image.size == SIZE
    assert comparison.to_json()["results"][0]["image"] == str(folder / "off.png")


def layers(path: Path) -> dict[str, np.ndarray]:
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels.astype(np.float64) for name, channel in file.channels().items()}


def test_errors_can_be_measured_again_from_the_folder(comparison: Comparison, tmp_path: Path) -> None:
    comparison.save(tmp_path / "out")
    document = json.loads((tmp_path / "out/results.json").read_text())
    truth = layers(tmp_path / "out" / document["reference"]["still_exr"])
    for result in document["results"]:
        still = layers(tmp_path / "out" / result["still_exr"])
        for kind, prefix in (("inscattered", "inscatter."), ("radiance", "")):
            x, r = (np.stack([file[prefix + c] for c in "RGB"], axis=-1) for file in (still, truth))
            assert metrics.rel_rmse(x, r) == pytest.approx(result["errors"][kind]["rel_rmse"], rel=1e-4)
        for c in "RGB":
            np.testing.assert_allclose(still[c], still[f"inscatter.{c}"] + still[f"surfaces.{c}"], rtol=3e-3, atol=1e-3)
        assert set(layers(tmp_path / "out" / result["exr"])) == {"R", "G", "B", "Z"}


def test_a_report_is_one_more_file(comparison: Comparison, tmp_path: Path) -> None:
    page = comparison.report(tmp_path / "out")
    assert page.parent == tmp_path / "out"
    assert "froxel" in page.read_text()


def test_an_interrupted_save_leaves_nothing(
    comparison: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tyndall.lab.comparison.strip", interrupt)
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
        ({"truth": "trced"}, "truth: 'trced' is not one of 'traced', 'march', 'mitsuba' — did you mean 'traced'?"),
        ({"truth": "march", "family": "shadow"}, "cannot judge it; use 'traced'"),
        ({"truth": "march", "truth_settings": TruthSettings()}, "truth: only one that is traced"),
        ({"truth_settings": TruthSettings(filter="box")}, "filter: "),
        ({"family": "tonemap"}, "family: 'tonemap' is not one of"),
        ({"shadow": ["shadow_map", "ray_traced"]}, "shadow: 2 techniques, but it is volumetric techniques that"),
        ({"family": "shadow", "shadow": "froxel"}, "no shadow technique 'froxel'"),
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
    options = {"size": (16, 9), "truth": None, "frames": 1, "warmup": 0, "adapter": gpu, "parameters": SHADOW}
    found = compare(scene, volumetric=twice, out=tmp_path, **options)  # type: ignore[arg-type]
    assert [result.label for result in found.results] == ["froxel", "froxel-2"]
    assert {path.name for path in tmp_path.glob("*.png")} == {"froxel.png", "froxel-2.png"}
    assert found.to_json()["parameters"]["volumetric"]["froxel-2"]["grid"] == (8, 8, 8)
    alone = compare(scene, volumetric="off", **options)  # type: ignore[arg-type]
    assert [result.technique for result in alone.results] == ["off"]


def test_an_adapter_without_timers_gives_no_times(gpu: Gpu, scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu, "_timed", False)
    found = compare(
        scene, size=(16, 9), volumetric=["froxel"], truth="none", frames=1, warmup=0, adapter=gpu, parameters=SMALL
    )
    (result,) = found.to_json()["results"]
    assert result["gpu_ms"] is None
    assert result["frame_ms"] is None
    assert result["memory_bytes"] > 0
    assert "timestamp-query" in str(found)


def test_the_path_of_a_scene_is_no_scene() -> None:
    for function in (render, compare):
        with pytest.raises(ParameterError, match="^scene: 'room.json' is no Scene; tyndall.load reads one"):
            function("room.json")  # type: ignore[operator]


def test_a_vacuum_has_no_relative_error(gpu: Gpu, scene: Scene) -> None:
    vacuum = scene.with_(medium=Medium())
    options: dict[str, Any] = {"truth": "march", "frames": 1, "warmup": 0, "adapter": gpu, "parameters": SMALL}
    found = compare(vacuum, size=(32, 18), volumetric=["froxel"], **options)
    (result,) = found.results
    assert result.error is None
    assert found.to_json()["results"][0]["errors"]["inscattered"]["rel_rmse"] is None
    assert result.scores["radiance"].rel_rmse == pytest.approx(0, abs=1e-4)
    assert "–" in str(found)


# --- truths -------------------------------------------------------------------------------------------------------


def test_a_truth_s_noise_is_taken_off(gpu: Gpu, scene: Scene, noisy: Truth) -> None:
    options: dict[str, Any] = {"frames": 1, "warmup": 0, "adapter": gpu, "parameters": SHADOW, "truth": noisy}
    found = compare(scene, size=SIZE, volumetric=["off", March(steps=512, jitter=0)], **options)
    off, march = (result.main for result in found.results)
    assert march.rel_rmse == pytest.approx(0.2, rel=0.02)
    assert march.within_noise
    assert march.rel_rmse_corrected < march.rel_rmse_limit < 0.05
    assert not off.within_noise
    assert off.rel_rmse_corrected < off.rel_rmse
    lines = str(found).splitlines()
    assert f"<{100 * march.rel_rmse_limit:.2f}" in next(line for line in lines if line.startswith("march"))
    assert "hidden in the truth's noise" in str(found)
    document = found.to_json()["reference"]
    assert (document["judge"], document["samples"], document["seconds"]) == ("noise", 64, 1.5)
    assert document["relative_error"]["inscattered"] == pytest.approx(0.2, rel=0.05)
    assert "20 % of L_v" in str(found)


def test_a_truth_of_another_size_is_refused(gpu: Gpu, scene: Scene, noisy: Truth) -> None:
    with pytest.raises(ParameterError, match="^truth: is 64×36 pixels, and the comparison 32×18$"):
        compare(scene, size=(32, 18), truth=noisy, adapter=gpu)


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TYNDALL_CACHE", str(tmp_path / "cache"))


@pytest.mark.usefixtures("own_cache")
def test_shadows_are_judged_by_the_light_of_surfaces(gpu: Gpu, scene: Scene) -> None:
    """Rays agree with the traced truth but for textures' filters, and maps the better the finer they are."""
    found = compare(
        scene,
        size=SIZE,
        family="shadow",
        shadow=[ShadowMap(size=64), ShadowMap(size=1024), RayTraced()],
        volumetric="froxel",
        parameters=GRID,
        truth_settings=TruthSettings(samples=32, target=1.0),
        frames=1,
        warmup=0,
        adapter=gpu,
    )
    assert [result.label for result in found.results] == ["shadow_map", "shadow_map-2", "ray_traced"]
    coarse, fine, rays = (result.scores["surfaces"] for result in found.results)
    assert rays.rel_rmse_corrected < 0.15
    assert rays.rel_rmse_corrected < fine.rel_rmse_corrected < coarse.rel_rmse_corrected
    assert rays.boundary < fine.boundary < coarse.boundary
    assert coarse.boundary > coarse.rel_rmse
    document = found.to_json()
    assert document["family"] == "shadow"
    assert document["reference"]["judge"] == "traced"
    assert set(document["parameters"]["shadow"]) == {"shadow_map", "shadow_map-2", "ray_traced"}
    assert document["parameters"]["volumetric"]["technique"] == "froxel"
    assert document["results"][0]["gpu_ms"]["median"] == pytest.approx(
        document["results"][0]["passes"]["shadow.shadow_map"]
    )
    assert found["shadow_map-2"].memory_bytes >= 4 * 1024**2


@pytest.mark.usefixtures("own_cache")
@pytest.mark.parametrize("volumetric", [None, "off"])
def test_shadows_are_compared_without_the_air(gpu: Gpu, scene: Scene, volumetric: str | None) -> None:
    """So that neither its light nor its rays are a shadow technique's, and frame and truth agree on what dims."""
    found = compare(
        scene,
        size=SIZE,
        family="shadow",
        shadow=["ray_traced"],
        volumetric=volumetric,
        truth_settings=TruthSettings(samples=32, target=1.0),
        frames=1,
        warmup=0,
        adapter=gpu,
    )
    (rays,) = found.results
    assert rays.scores["surfaces"].rel_rmse_corrected < 0.15
    assert abs(rays.scores["surfaces"].bias) < 0.02
    assert found.to_json()["parameters"]["volumetric"]["technique"] == "off"


def test_the_march_judges_the_technique_and_not_the_map(gpu: Gpu, scene: Scene, noisy: Truth) -> None:
    """Through a map of 64 texels a right technique has no error where the truth has the same map, and else it has."""
    options: dict[str, Any] = {"size": SIZE, "frames": 1, "warmup": 0, "adapter": gpu, "shadow": ShadowMap(size=64)}
    march = March(steps=512, jitter=0)
    same = compare(scene, volumetric=march, truth="march", **options)["march"].main
    true = compare(scene, volumetric=march, truth=noisy, **options)["march"].main
    assert same.rel_rmse < 0.01
    assert true.rel_rmse_corrected > 0.1
    assert not true.within_noise


# --- workers ------------------------------------------------------------------------------------------------------


def test_errors_that_could_not_be_measured_are_a_line(
    gpu: Gpu, scene: Scene, noisy: Truth, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(judging, "_PROGRAM", "raise SystemExit(9)")
    options: dict[str, Any] = {"frames": 1, "warmup": 0, "adapter": gpu, "parameters": SHADOW, "truth": noisy}
    found = compare(scene, size=SIZE, volumetric=["off"], out=tmp_path / "out", **options)
    assert found["off"].error is None
    assert found.missing == {"off": "the process that measures them died twice (exit code 9)"}
    assert "off: no errors: the process that measures them died twice" in str(found)
    assert json.loads((tmp_path / "out/results.json").read_text())["missing"] == found.missing


@pytest.mark.parametrize(("adapter_type", "order"), [("CPU", "ddss"), ("DiscreteGPU", "dsds")])
def test_workers_run_beside_a_gpu_but_not_beside_a_processor_that_draws(
    gpu: Gpu, scene: Scene, noisy: Truth, monkeypatch: pytest.MonkeyPatch, adapter_type: str, order: str
) -> None:
    happened: list[str] = []

    def hearing(what: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*args: Any, **named: Any) -> Any:
            happened.append(what)
            return function(*args, **named)

        return wrapped

    monkeypatch.setitem(gpu.adapter_info, "adapter_type", adapter_type)
    monkeypatch.setattr("tyndall.lab.compare.cores", lambda: 4)
    monkeypatch.setattr("tyndall.lab.compare.measure", hearing("d", real_measure))
    monkeypatch.setattr(judging.Judges, "submit", hearing("s", judging.Judges.submit))
    options: dict[str, Any] = {"frames": 1, "warmup": 0, "adapter": gpu, "parameters": SHADOW, "truth": noisy}
    compare(scene, size=SIZE, volumetric=["off", "march"], **options)
    assert "".join(happened) == order


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
    options: dict[str, Any] = {"truth": "march", "frames": 1, "warmup": 0, "adapter": gpu, "parameters": SMALL}
    compare(scene, size=(16, 9), volumetric=["froxel"], **options)
    assert gpu.ledger.total == before
