"""Each command of the command line, at tiny sizes; each mistake, with its one line and nothing left behind."""

from __future__ import annotations

import dataclasses
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import tyndall
from tyndall.app.cli import main
from tyndall.gpu.params import fields_of
from tyndall.lab import bench, bench_sdf, bench_shadows
from tyndall.scene.model import Implicit, Scene
from tyndall.sdf import sphere
from tyndall.techniques import FAMILIES

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Commands run in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command."""
    code = main(words)
    out, err = capsys.readouterr()
    return code, out, err


def run_json(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    """The JSON document that a command prints; there must be nothing else on stdout."""
    code, out, err = run(capsys, *words, "--json")
    assert code == 0, err
    return json.loads(out)


def pixels_of(path: Path) -> np.ndarray[Any, Any]:
    """(H, W, 3) uint8."""
    with Image.open(path) as image:
        return np.asarray(image)


# --- lists --------------------------------------------------------------------------------------------------------


def test_no_words_show_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys)
    assert code == 0
    assert all(command in out for command in ("render", "compare", "scenes", "techniques", "doctor", "bench"))


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "--version") == (0, f"tyndall {tyndall.__version__}\n", "")


def test_techniques_lists_every_parameter_of_every_technique(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "techniques")
    assert code == 0
    for family in FAMILIES.values():
        for name, technique in family.members.items():
            assert technique.advice.split()[-1] in out
            for field in fields_of(technique):
                assert f"--{name}.{field.name}" in out


def test_techniques_as_json_can_be_given_back_as_flags(capsys: pytest.CaptureFixture[str]) -> None:
    listed = run_json(capsys, "techniques")
    assert {(t["family"], t["name"]) for t in listed} == {
        ("marching", "marching"),
        *((f.name, name) for f in FAMILIES.values() for name in f.members),
    }
    (froxel,) = run_json(capsys, "techniques", "froxel")
    grid = next(p for p in froxel["parameters"] if p["name"] == "grid")
    assert grid["flag"] == "--froxel.grid"
    assert len(grid["default"]) == 3
    assert froxel["paper"]


def test_techniques_of_a_family(capsys: pytest.CaptureFixture[str]) -> None:
    assert {t["family"] for t in run_json(capsys, "techniques", "shadow")} == {"shadow"}


def test_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    listed = {scene["name"]: scene["triangles"] or scene["nodes"] for scene in run_json(capsys, "scenes")}
    assert listed == {
        "box": 4968, "blinds": 607402, "courtyard": 5608441,
        "shadows": 1000, "foliage": 22334, "interior": 23396, "fence": 49894,
        "portrait": 762, "snail": 1060, "jumper": 683, "temple": 1377, "swarm": 4003,
    }  # fmt: skip
    code, out, _ = run(capsys, "scenes")
    assert code == 0
    assert "5,608,441" in out


def test_doctor_finds_an_adapter_to_draw_with(capsys: pytest.CaptureFixture[str]) -> None:
    report = run_json(capsys, "doctor")
    assert report["can_render"]
    assert sum(adapter["chosen"] for adapter in report["adapters"]) == 1
    assert report["packages"]["wgpu"]
    code, out, err = run(capsys, "doctor")
    assert (code, err) == (0, "")
    assert report["adapters"][0]["name"] in out
    words = " ".join(out.split())
    assert all(f"{name} {version or 'missing (pip install'}" in words for name, version in report["extras"].items())


def test_doctor_fails_where_the_wanted_adapter_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "doctor", "--adapter", "voodoo")
    assert code == 2
    assert "no adapter matches 'voodoo'" in out
    assert "cannot draw" in out


# --- pictures -----------------------------------------------------------------------------------------------------


def test_render_writes_a_png_and_an_exr(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    words = ("render", "box", "--size", "48x27", "--frames", "2", "--froxel.grid", "16,9,8", "--out", "made/here")
    document = run_json(capsys, *words)
    assert document["scene"] == "box"
    assert document["triangles"] == 4968
    assert document["size"] == [48, 27]
    pixels = pixels_of(folder / document["image"])
    assert pixels.shape == (27, 48, 3)
    assert pixels.std() > 1, "a picture of one colour"
    assert sorted(p.name for p in (folder / "made/here").iterdir()) == ["froxel.exr", "froxel.png"]


def test_a_view_is_drawn_in_place_of_the_picture(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    document = run_json(capsys, "render", "box", "--size", "48x27", "--view", "normals", "--out", "made")
    assert document["view"] == "normals"
    pixels = pixels_of(folder / document["image"])
    assert pixels.shape == (27, 48, 3)
    assert sorted(p.name for p in (folder / "made").iterdir()) == ["normals.png"]
    for words, said in (
        (("--view", "step"), "did you mean 'steps'"),
        (("--view", "steps"), "box has none"),
        (("--time", "1"), "nothing moves in box"),
        (("--time", "nan"), "--time: nan is not a finite number"),
        (("--time=-inf",), "--time: -inf is not a finite number"),
        (("--marching.steps", "8"), "--marching.steps: box has no implicit surfaces"),
        (("--marching.step", "8"), "did you mean 'steps'"),
        (("--marching.threshold", "9"), "--marching.threshold: 9 is outside 0 … 8"),
    ):
        code, _, err = run(capsys, "render", "box", *words, "--out", "other")
        assert (code, said in err) == (2, True), err
    assert not (folder / "other").exists()


@pytest.mark.parametrize("view", [(), ("--view", "depth")])
def test_how_rays_are_marched_reaches_the_picture(
    capsys: pytest.CaptureFixture[str], folder: Path, view: tuple[str, ...]
) -> None:
    """Rays that go no farther than a centimetre meet nothing."""
    near = ("--marching.distance", "0.01")
    drawn = ("render", "swarm:10", "--size", "32x18", "--frames", "1", "--technique", "off", *near, *view)
    pixels = pixels_of(folder / run_json(capsys, *drawn)["image"])
    assert np.ptp(pixels, axis=(0, 1)).max() <= 1


def test_the_seed_and_the_parameters_reach_the_picture(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    def pixels(*words: str) -> np.ndarray[Any, Any]:
        document = run_json(capsys, "render", "box", "--size", "32x18", "--frames", "1", *words)
        return pixels_of(folder / document["image"])

    plain = pixels("--technique", "march", "--march.steps", "8")
    assert np.array_equal(plain, pixels("--technique", "march", "--march.steps", "8"))
    assert not np.array_equal(plain, pixels("--technique", "march", "--march.steps=2", "--march.jitter=0"))
    assert not np.array_equal(plain, pixels("--technique", "off"))


def test_compare_prints_the_documented_json_and_fills_a_folder(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    words = ("compare", "box", "--technique", "off,froxel", "--size", "48x27", "--frames", "1", "--warmup", "0")
    words += ("--froxel.grid", "16,9,8", "--truth", "march", "--out", "result")
    document = run_json(capsys, *words)
    assert {"adapter", "scene", "triangles", "size", "results"} <= set(document)
    assert [result["technique"] for result in document["results"]] == ["off", "froxel"]
    for result in document["results"]:
        assert {"technique", "model", "gpu_ms", "frame_ms", "memory_bytes", "error", "image"} <= set(result)
        assert set(result["gpu_ms"]) == {"median", "min", "p95"}
        assert set(result["error"]) == {"rel_rmse", "psnr", "bias"}
        assert pixels_of(folder / result["image"]).shape == (27, 48, 3)
    off, froxel = document["results"]
    assert off["error"]["rel_rmse"] > froxel["error"]["rel_rmse"] > 0
    assert froxel["memory_bytes"] > off["memory_bytes"]
    kept = json.loads((folder / "result/results.json").read_text())
    assert kept["scene_hash"]
    assert kept["parameters"]["volumetric"]["froxel"]["grid"] == [16, 9, 8]
    assert kept["command"] == shlex.join(["tyndall", *words, "--json"])
    assert not (folder / "result/report.html").exists()


def test_shadows_are_compared_against_a_traced_truth_and_reported(
    capsys: pytest.CaptureFixture[str], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TYNDALL_CACHE", str(folder / "cache"))
    words = ("compare", "box", "--family", "shadow", "--technique", "shadow_map", "--volumetric", "march")
    words += ("--truth.target", "1", "--truth.samples", "32", "--size", "32x18", "--frames", "1", "--report")
    code, out, err = run(capsys, *words, "--out", "made")
    assert code == 0, err
    assert "the report is made/report.html" in out
    assert "truth: traced, 32 samples a pixel" in out
    kept = json.loads((folder / "made/results.json").read_text())
    assert kept["reference"]["settings"]["target"] == 1
    assert kept["parameters"]["volumetric"]["technique"] == "march"
    assert "<html" in (folder / "made/report.html").read_text()


def test_compare_prints_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("compare", "box", "--technique", "off", "--truth", "none", "--size", "16x9", "--frames", "1")
    code, out, _ = run(capsys, *words)
    assert code == 0
    assert "off" in out
    assert "out/box" in out


def test_a_mesh_file_is_put_on_a_stage(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "mesh.obj").write_text(TETRAHEDRON)
    document = run_json(capsys, "render", "mesh.obj", "--size", "32x18", "--frames", "1", "--technique", "march")
    assert document["triangles"] > 4, "no ground"
    assert pixels_of(folder / document["image"]).std() > 1


def test_a_name_in_a_scene_file_does_not_choose_the_folder(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    scene = tyndall.Scene(lights=(tyndall.DirectionalLight(),), name="../../elsewhere")
    tyndall.save(scene, folder / "beam.json")
    document = run_json(capsys, "render", "beam.json", "--size", "16x9", "--frames", "1", "--technique", "off")
    assert document["image"] == "out/beam/off.png"
    assert {p.name for p in folder.iterdir() if p.suffix != ".bin"} == {"beam.json", "out"}


def test_lights_are_placed_in_a_bundled_scene(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    images = [
        run_json(capsys, "render", "box", "--lights", n, "--size", "16x9", "--frames", "1", "--out", n)["image"]
        for n in ("1", "3")
    ]
    one, three = (pixels_of(folder / image) for image in images)
    assert not np.array_equal(one, three)


def test_a_scene_may_be_asked_for_any_number_of_triangles(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    words = ("--size", "16x9", "--frames", "1", "--technique", "off")
    document = run_json(capsys, "render", "shadows:137", *words)
    assert (document["triangles"], document["image"]) == (137, "out/shadows-137/off.png")
    code, _, err = run(capsys, "render", "shadows:7", *words)
    assert (code, err) == (2, "tyndall: triangles: 7 is outside 10 … 10000000\n")


def test_bench_writes_its_figures_as_json_and_as_tables(
    capsys: pytest.CaptureFixture[str], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    smaller = dataclasses.replace(bench.QUICK, size=(16, 9), shadow_size=64, grid=(8, 4, 4), frames=1, warmup=0)
    tiny = dataclasses.replace(smaller, lights=(1, 2), error_scenes=(), truth_scenes=())
    monkeypatch.setattr(bench, "QUICK", tiny)
    code, out, err = run(capsys, "bench", "volumetric", "--quick", "--out", "figures")
    assert code == 0, err
    assert "| box (4,968) | froxel |" in out
    kept = json.loads((folder / "figures/volumetric.json").read_text())
    assert {row["technique"] for row in kept["scenes"]} >= {"off", "froxel", "march"}
    _, out, err = run(capsys, "bench", "volumetric", "--quick", "--out", "figures", "--json")
    assert json.loads(out) == kept
    assert "12 of 12 points were measured before" in err


def test_bench_of_implicit_surfaces_writes_its_figures(
    capsys: pytest.CaptureFixture[str], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tiny = dataclasses.replace(bench_sdf.QUICK, parts=("agreement",), agreement=("ball",), points=64)
    monkeypatch.setattr(bench_sdf, "QUICK", tiny)
    monkeypatch.setattr(bench_sdf, "open_scene", lambda name: Scene(implicits=(Implicit(sphere()),)))
    code, out, err = run(capsys, "bench", "sdf", "--quick", "--seconds", "0.5", "--out", "figures")
    assert code == 0, err
    assert "### Pruned and whole values" in out
    document = json.loads((folder / "figures/sdf.json").read_text())
    assert document["settings"]["seconds"] == 0.5
    _, out, err = run(capsys, "bench", "sdf", "--quick", "--out", "figures", "--json")
    assert json.loads(out)["agreement"][0]["still"]["points"] == 64


def test_bench_of_shadows_writes_its_figures_and_goes_on(
    capsys: pytest.CaptureFixture[str], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tiny = dataclasses.replace(
        bench_shadows.QUICK,
        parts=("cells",),
        techniques=("shadow_map",),
        size=(16, 12),
        triangles=(10, 100),
        lights=(1,),
        frames=1,
        warmup=0,
    )
    monkeypatch.setattr(bench_shadows, "QUICK", tiny)
    code, out, err = run(capsys, "bench", "shadows", "--quick", "--out", "figures")
    assert code == 0, err
    assert "| `shadow_map` | 100 |" in out
    assert {path.name for path in (folder / "figures").iterdir()} == {"shadows.json", "shadows.jsonl", "shadows.md"}
    kept = json.loads((folder / "figures/shadows.json").read_text())
    assert [row["triangles"] for row in kept["cells"]] == [10, 100]
    _, out, err = run(capsys, "bench", "shadows", "--quick", "--out", "figures", "--json")
    assert json.loads(out) == kept
    assert "2 of 2 figures were measured before" in err
    _, _, err = run(capsys, "bench", "shadows", "--quick", "--out", "figures", "--fresh")
    assert "before" not in err


def test_sweep_measures_what_flags_say_and_goes_on(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    words = ("sweep", "--scenes", "box", "--techniques", "off,froxel", "--sizes", "16x9", "--frames", "1")
    more = (*words, "--froxel.grid", "8x4x4,16x9x8", "--workers", "0", "--format", "csv", "--out", "kept")
    document = run_json(capsys, *more)
    assert [row["point"]["technique"].get("grid") for row in document["rows"]] == [None, [8, 4, 4], [16, 9, 8]]
    kept = {path.name for path in (folder / "kept").iterdir()}
    assert kept == {"results.jsonl", "results.csv", "spec.json", "points.json"}
    code, out, _ = run(capsys, *more)
    assert code == 0
    assert "3 of 3 points were measured before" in out
    assert run_json(capsys, "sweep", "kept/spec.json", "--out", "kept")["reused"] == 3


def test_a_sweep_with_mistakes_is_refused_whole(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    flags = (
        "--scenes boxs --techniques froxl --sizes 16 --lights 0 --march.stepz 3 --truth.tagret 1 --frames x --seed -1"
    )
    code, out, err = run(capsys, "sweep", *flags.split(), "--froxel.grid", "1x2")
    assert (code, out) == (2, "")
    for said in (
        "--scenes: no scene 'boxs'",
        "--techniques: no volumetric technique 'froxl' — did you mean 'froxel'?",
        "--sizes: '16'",
        "--march.stepz: 'march' has no parameter 'stepz' — did you mean 'steps'?",
        "--froxel.grid: '1x2' is not 3 whole numbers",
        "--truth.tagret: no such setting — did you mean 'target'?",
        "--frames: 'x' is not a whole number",
        "--seed: -1 is outside",
    ):
        assert sum(line.startswith(f"tyndall: {said}") for line in err.splitlines()) == 1, (said, err)
    assert list(folder.iterdir()) == []


def test_a_specification_in_a_file_is_not_mixed_with_flags(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "spec.json").write_text('{"scenes": "box"}')
    for flag in ("--scenes", "--march.steps"):
        code, _, err = run(capsys, "sweep", "spec.json", flag, "3")
        assert (code, err) == (2, f"tyndall: {flag}: spec.json says what is measured; write it there\n")


# --- mistakes -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("rendr box", "Did you mean 'render'?"),
        ("render", "SCENE"),
        ("render boxs", "did you mean 'box'?"),
        ("render nothing.glb", "nothing.glb"),
        ("render .", "."),
        ("render box --siez 4x4", "did you mean '--size'?"),
        ("render box --size", "--size"),
        ("render box --size 640", "--size: '640' is not WIDTHxHEIGHT"),
        ("render box --size 0x360", "--size: a picture of 0×360 has no pixels"),
        ("render box --size 999999x4", "limit"),
        ("render box --size 16x9 --adapter voodoo", "no adapter matches 'voodoo'"),
        ("render box --technique froxle", "did you mean 'froxel'?"),
        ("render box --technique off,froxel", "--technique: 'off,froxel' is not one technique"),
        ("render box --seed -1", "--seed"),
        ("render box --seed 4294967296", "--seed"),
        ("render box --shadow shadowmap", "did you mean 'shadow_map'?"),
        ("render box --occlusion ray_traced", "did you mean 'ray_traced_ao'?"),
        ("render box --froxel.gird 1,2,3", "--froxel.gird: 'froxel' has no parameter 'gird' — did you mean 'grid'?"),
        ("render box --froxle.grid 1,2,3", "did you mean 'froxel'?"),
        ("render box --froxel.grid 1,2", "--froxel.grid: '1,2' is not 3 whole numbers"),
        ("render box --froxel.grid 0,2,3", "--froxel.grid: 0 is outside"),
        ("render box --froxel.grid", "--froxel.grid: needs a value"),
        ("render box --march.steps 4", "--march.steps: 'march' is not drawn here"),
        ("render box --technique march --model paper", "--model: 'march' has one model only"),
        ("render box --model paprika", "'paper'"),
        ("render box --lights 0", "lights"),
        ("render box --lights 33", "lights"),
        ("render box --lights two", "--lights"),
        ("render box --frames 0", "--frames"),
        ("render box --out taken/inside", "taken"),
        ("compare box --technique off,frxel", "did you mean 'froxel'?"),
        ("compare box --technique ,", "--technique: no name is given"),
        ("compare box --truth froxel --technique off --size 16x9", "'march'"),
        ("compare box --truth.trget 1", "--truth.trget: 'truth' has no parameter 'trget' — did you mean 'target'?"),
        ("compare box --truth.target 2", "--truth.target: 2 is outside 0 … 1"),
        ("compare box --truth march --truth.seconds 3 --size 16x9", "only one that is traced"),
        ("compare box --truth.filter box --size 16x9", "filter: "),
        ("compare box --family shadow --truth march --size 16x9", "cannot judge it; use 'traced'"),
        ("compare box --family shadow --technique froxel", "no shadow technique 'froxel'"),
        ("compare box --family shadow --shadow shadow_map", "--shadow: it is shadow techniques that are compared"),
        ("compare box --family shadow --model both", "--model: only volumetric techniques have models"),
        ("compare box --volumetric froxel", "--volumetric: it is volumetric techniques that are compared"),
        ("render box --truth.seconds 3", "--truth.seconds: no technique 'truth'"),
        ("compare broken.json", "broken.json"),
        ("techniques froxl", "did you mean 'froxel'?"),
        ("doctor --froxel.grid 1,2,3", "--froxel.grid"),
    ],
)
def test_a_mistake_gets_one_line_and_leaves_nothing(
    command: str, message: str, capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    (folder / "taken").write_text("a file")
    (folder / "broken.json").write_text('{"camera": 7')
    code, out, err = run(capsys, *command.split())
    assert (code, out) == (2, "")
    assert message in err
    assert err.startswith("tyndall: ")
    assert err.count("\n") == 1, err
    assert sorted(p.name for p in folder.iterdir()) == ["broken.json", "taken"]
    assert (folder / "taken").read_text() == "a file"


def test_debug_shows_where_an_error_came_from() -> None:
    with pytest.raises(ValueError, match="no scene 'boxs'"):
        main(["render", "boxs", "--debug"])


def test_a_fault_is_not_called_a_mistake(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: object) -> None:
        raise KeyError("lost")

    monkeypatch.setattr("tyndall.app.doctor.diagnose", broken)
    code, out, err = run(capsys, "doctor")
    assert (code, out) == (1, "")
    assert err == "tyndall: this is a fault in Tyndall: KeyError: 'lost' (--debug shows where)\n"


def test_what_was_in_the_folder_stays(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "result").mkdir()
    (folder / "result/notes.txt").write_text("mine")
    words = ("compare", "box", "--technique", "off", "--truth", "none", "--size", "16x9", "--frames", "1")
    assert run(capsys, *words, "--out", "result")[0] == 0
    assert (folder / "result/notes.txt").read_text() == "mine"
    assert (folder / "result/off.png").exists()


def test_an_interrupt_leaves_no_half_written_file(folder: Path) -> None:
    # Without a truth: a driver that compiles a large shader hears of no interrupt before it is done.
    words = ("compare", "box", "--size", "320x180", "--frames", "5000", "--truth", "none", "--out", "result")
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "tyndall", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment
    )
    time.sleep(4)
    assert process.poll() is None, process.communicate()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out == b""
    assert b"Traceback" not in err
    assert list(folder.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="signals and shells of POSIX")
def test_an_interrupt_during_the_imports_is_quiet(folder: Path) -> None:
    (folder / "numpy.py").write_text("import os, signal, time; os.kill(os.getpid(), signal.SIGINT); time.sleep(9)")
    result = subprocess.run([sys.executable, "-m", "tyndall", "scenes"], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout, result.stderr) == (130, "", "")


@pytest.mark.skipif(sys.platform == "win32", reason="signals and shells of POSIX")
def test_closed_and_full_streams_are_no_faults() -> None:
    command = f"'{sys.executable}' -m tyndall scenes"
    for redirection, code, said in ((">&-", 0, ""), (">/dev/full", 2, "tyndall: No space left on device\n")):
        result = subprocess.run(f"{command} {redirection}", shell=True, capture_output=True, text=True, check=False)
        assert (result.returncode, result.stderr) == (code, said)


def test_parameters_in_a_scene_file_are_named_with_the_file(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    looks = {"froxl": {"samples": 2}, "froxel": {"gird": [1, 1, 1]}, "march": {"steps": 0}, "marching": {"step": 9}}
    (folder / "room.json").write_text(json.dumps({"version": 1, "looks": looks}))
    code, _, err = run(capsys, "render", "room.json")
    assert code == 2
    assert err.splitlines() == [
        "tyndall: room.json: looks.froxl: no such technique — did you mean 'froxel'?",
        "tyndall: room.json: looks.froxel.gird: no such parameter — did you mean 'grid'?",
        "tyndall: room.json: looks.march.steps: 0 is outside 1 … 30000",
        "tyndall: room.json: looks.marching.step: no such parameter — did you mean 'steps'?",
    ]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a file's name is Unicode")
def test_a_file_s_name_need_not_be_unicode(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    name = os.fsdecode(b"caf\xe9.obj")
    (folder / name).write_text(TETRAHEDRON)
    assert run(capsys, "render", name, "--size", "8x8", "--frames", "1", "--technique", "off", "--out", "made")[0] == 0
    assert pixels_of(folder / "made/off.png").shape == (8, 8, 3)


def test_a_name_in_a_scene_file_cannot_steer_the_terminal(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "room.json").write_text(json.dumps({"version": 1, "name": "a\x1b[31m\nb"}))
    code, out, _ = run(capsys, "render", "room.json", "--size", "8x8", "--frames", "1", "--technique", "off")
    assert code == 0
    assert "\x1b" not in out
    assert len(out.splitlines()) == 2


def test_the_command_is_installed_and_is_a_module() -> None:
    result = subprocess.run(
        [sys.executable, "-m", "tyndall", "render", "boxs"], capture_output=True, text=True, check=False
    )
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
