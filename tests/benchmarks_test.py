"""The figures in the documentation are those that were measured."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import pytest

from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Implicit, Material, Scene
from tyndall.sdf import box, sphere, union

ROOT = Path(__file__).parents[1]
RESULTS = sorted((ROOT / "benchmarks" / "results").glob("*.json"))


def test_the_page_holds_the_tables_of_every_result(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")  # as for a script that is run
    script = runpy.run_path(str(ROOT / "benchmarks" / "update_docs.py"))
    page = script["PAGE"].read_text(encoding="utf-8")
    assert script["updated"](page) == page, "run python benchmarks/update_docs.py"
    for path, text in script["images"]().items():
        assert path.read_text(encoding="utf-8") == text, "run python benchmarks/update_docs.py"


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_a_result_names_its_adapter_versions_and_scenes(path: Path) -> None:
    document = json.loads(path.read_text(encoding="utf-8"))
    assert document["adapter"]
    assert document["driver"]
    assert document["versions"]["tyndall"]
    hashes = (
        [document["scene_hash"]]
        if "scene_hash" in document
        else [row["scene_hash"] for row in document["scenes"] if "failed" not in row.get("ours", {})]
    )
    assert all(len(digest) == 64 for digest in hashes)


def test_the_shadow_benchmark_and_its_peer_make_one_document(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Without pygfx, which is no dependency, the document says so; with it, it has its cells."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    words = "--quick --parts cells --cells 10x1,20x2 --techniques shadow_map --frames 1 --seconds 0.1"
    monkeypatch.setattr("sys.argv", ["shadows.py", *words.split(), "--out", str(tmp_path)])
    runpy.run_path(str(ROOT / "benchmarks" / "shadows.py"), run_name="__main__")
    document = json.loads(capsys.readouterr().out)
    assert [(row["triangles"], row["lights"]) for row in document["cells"]] == [(10, 1), (20, 2)]
    peer = document["peer"]
    assert "failed" in peer or len(peer["cells"]) == 2
    assert json.loads((tmp_path / "shadows.json").read_text(encoding="utf-8")) == document
    assert "### Beside pygfx" in (tmp_path / "shadows.md").read_text(encoding="utf-8")


def test_what_pygfx_is_given_is_the_same_light(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    peer = runpy.run_path(str(ROOT / "benchmarks" / "peer_pygfx.py"))
    assert peer["parse_cells"]("100000x5,10x1") == ((100_000, 5), (10, 1))
    # sRGB's own fixed points, and its curve at middle grey.
    assert peer["srgb"]((0.0, 1.0)) == pytest.approx((0.0, 1.0))
    assert peer["srgb"]((0.2140,)) == pytest.approx((0.5,), abs=1e-3)


def test_what_wgpu_shadertoy_is_given_is_the_same_loop(
    gpu: Gpu, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Its text compiles under wgpu-shadertoy's rules; where the package is not, the document says so."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    peer = runpy.run_path(str(ROOT / "benchmarks" / "peer_shadertoy.py"))
    shape = union(sphere(0.5), box(0.6).at(0.5).material(Material(emissive=(1, 2, 3))), smooth=0.1)
    scene = Scene(
        lights=(DirectionalLight(),), camera=Camera((0, 1, 3)), ambient=(0.1, 0.2, 0.3), implicits=(Implicit(shape),)
    )
    text = peer["shader"](scene, (32, 18))
    given = """
        var<private> i_frame: u32;
        var<private> i_resolution: vec3<f32>;
        @fragment fn main(@builtin(position) at: vec4f) -> @location(0) vec4f { return shader_main(at.xy); }
    """
    gpu.device.create_shader_module(label="toy", code=given + text)
    assert text.count("@group") == 0
    monkeypatch.setattr(
        "sys.argv",
        ["sdf.py", "--quick", "--peer", "only", "--scenes", "no-such", "--swarm", "2000", "--out", str(tmp_path)],
    )
    runpy.run_path(str(ROOT / "benchmarks" / "sdf.py"), run_name="__main__")
    document = json.loads(capsys.readouterr().out)
    assert "failed" in document["peer"] or document["peer"]["scenes"] == []
    assert json.loads((tmp_path / "sdf.json").read_text(encoding="utf-8")) == document
    assert "### Beside wgpu-shadertoy" in (tmp_path / "sdf.md").read_text(encoding="utf-8")
