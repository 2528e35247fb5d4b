"""A specification is right as a whole, or every mistake in it is named; its points are the product, in order."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from tyndall.lab import sweep_spec
from tyndall.lab.standard import default_settings
from tyndall.lab.sweep_spec import SweepError, plan, read
from tyndall.scene.files import save
from tyndall.scene.model import DirectionalLight, PointLight, Scene

GRIDS = [[64, 36, 32], [160, 90, 64]]


def mistakes(spec: Any) -> list[str]:
    """What is said about a specification."""
    with pytest.raises(SweepError) as error:
        plan(spec)
    assert str(error.value).splitlines() == list(error.value.mistakes)
    return list(error.value.mistakes)


def descriptions(spec: Any) -> list[dict[str, Any]]:
    return [point.description for point in plan(spec).points]


def test_the_points_are_the_product_and_the_last_changes_fastest(tmp_path: Path) -> None:
    save(Scene(lights=(DirectionalLight(),)), tmp_path / "room.json")
    spec: dict[str, Any] = {
        "parts": [{"scenes": "box", "lights": [1, 2]}, {"scenes": str(tmp_path / "room.json")}],
        "sizes": ["64x36", [32, 18]],
        "techniques": [{"technique": "froxel", "grid": GRIDS, "samples": [1, 2]}, "off"],
        "shadow": {"technique": "shadow_map", "size": [128, 256]},
    }
    found = descriptions(spec)
    assert len(found) == (2 + 1) * 2 * 2 * (2 * 2 + 1)
    assert [Path(d["scene"]).name for d in found] == 40 * ["box"] + 20 * ["room.json"]
    assert [d["lights"] for d in found] == 20 * [1] + 20 * [2] + 20 * [1]
    assert [d["size"] for d in found[:20]] == 10 * [[64, 36]] + 10 * [[32, 18]]
    assert [d["shadow"]["size"] for d in found[:10]] == 5 * [128] + 5 * [256]
    froxels = [(d["technique"]["grid"], d["technique"]["samples"]) for d in found[:4]]
    assert froxels == [(GRIDS[0], 1), (GRIDS[0], 2), (GRIDS[1], 1), (GRIDS[1], 2)]
    assert found[4]["technique"] == {"technique": "off"}


def test_ids_are_the_content_s_and_stay() -> None:
    spec = {"scenes": "box", "techniques": "off", "sizes": "64x36"}
    (one,) = plan(spec).points
    (same,) = plan(json.loads(json.dumps({**spec, "sizes": [[64, 36]], "lights": 1}))).points
    assert one.id == same.id, "the same point in other words"
    others = [{"seed": 1}, {"lights": 2}, {"sizes": "36x64"}, {"techniques": "march"}, {"truth": "march"}]
    ids = {plan({**spec, **other}).points[0].id for other in others}
    assert len({one.id, *ids}) == 1 + len(others)


def test_a_scene_file_is_the_same_in_another_folder_but_not_with_another_content(tmp_path: Path) -> None:
    def id_of(folder: str, intensity: float) -> str:
        (tmp_path / folder).mkdir(exist_ok=True)
        save(Scene(lights=(DirectionalLight(intensity=intensity),)), tmp_path / folder / "room.json")
        (tmp_path / folder / "spec.json").write_text('{"scenes": "room.json", "techniques": "off"}')
        (point,) = read(tmp_path / folder / "spec.json").points  # a path in a file is relative to the file
        assert point.description["scene"] == str(tmp_path / folder / "room.json")
        return point.id

    assert id_of("here", 1.0) == id_of("there", 1.0)
    assert id_of("here", 1.0) != id_of("here", 2.0)


def test_a_point_that_is_asked_for_twice_is_measured_once() -> None:
    found = descriptions({"scenes": ["box", "box"], "techniques": ["off", "off"], "parts": [{}, {"lights": [1, 2]}]})
    assert [d["lights"] for d in found] == [1, 2]


def test_parts_start_from_the_fields_around_them() -> None:
    found = descriptions(
        {
            "scenes": "box",
            "sizes": "32x18",
            "parameters": {"march": {"steps": 8}},
            "frames": 3,
            "parts": [
                {"techniques": "march", "parameters": {"march": {"jitter": 0}}},
                {"techniques": "off", "sizes": "64x36", "frames": 0},
            ],
        }
    )
    march, off = found
    assert (march["technique"]["steps"], march["technique"]["jitter"]) == (8, 0)
    assert (march["size"], march["frames"]) == ([32, 18], 3)
    assert (off["size"], off["frames"]) == ([64, 36], 0)


def test_how_rays_are_marched_varies_where_there_is_something_to_march_through() -> None:
    found = descriptions(
        {"scenes": ["swarm:10", "box"], "techniques": "off", "parameters": {"marching": {"steps": [64, 256]}}}
    )
    assert [d.get("marching", {}).get("steps") for d in found] == [64, 256, None]
    assert found[0]["marching"]["distance"] == found[1]["marching"]["distance"] > 0, "with all of its parameters"


def test_a_judge_has_all_of_its_settings() -> None:
    (point,) = descriptions({"scenes": "box", "techniques": "off", "truth": {"judge": "traced", "target": 0.02}})
    assert point["truth"]["judge"] == "traced"
    assert point["truth"]["target"] == 0.02
    assert point["truth"]["depth"] == 2
    assert point["truth"]["seconds"] == default_settings("traced").seconds > 0, "as a comparison's"
    shadow = {"technique": "shadow_map", "size": 4096}
    (point,) = descriptions({"scenes": "box", "techniques": "off", "truth": {"judge": "march", "shadow": shadow}})
    assert point["truth"]["shadow"]["size"] == 4096
    assert descriptions({"scenes": "box", "techniques": "off"})[0]["truth"] is None


def test_a_technique_that_cannot_draw_a_scene_is_a_point_with_the_reason(tmp_path: Path) -> None:
    save(Scene(lights=(PointLight(),)), tmp_path / "lamp.json")
    spec = {"scenes": str(tmp_path / "lamp.json"), "techniques": [{"technique": "froxel", "model": "paper"}, "off"]}
    refused, drawn = plan(spec).points
    assert refused.refusal
    assert drawn.refusal is None


def test_every_mistake_is_named_at_once(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text('{"version": 1, "camera": 7}')
    spec = {
        "scenes": ["boxs", "nowhere.json", str(tmp_path / "broken.json"), "box", 3],
        "lights": [1, 40, "x"],
        "sizes": ["640x36O", [0, 4]],
        "techniques": ["froxl", {"technique": "froxel", "grid": [[1, 2], [0, 2, 3]], "gird": 3}, {"grid": [1, 1, 1]}],
        "parameters": {"frox": {}, "taa": {"blend": [0.5, 2]}, "agx": {}, "march": 7},
        "tonemap": [],
        "truth": {"judge": "traced", "tagret": 0.1, "depth": 1},
        "frames": -1,
        "trut": "none",
    }
    found = mistakes(spec)
    expected = [
        "scenes[0]: no scene 'boxs' — did you mean 'box'?",
        "scenes[1]: nowhere.json: no such file",
        f"scenes[2]: {tmp_path / 'broken.json'}: camera: 7 is not an object",
        "scenes[4]: 3 is neither the name of a scene nor the path of a file",
        "lights[1]: 40 is outside 1 … 32",
        "lights[2]: 'x' is not a whole number",
        "sizes[0]: '640x36O' is not a size",
        "sizes[1]: a picture of 0×4 has no pixels",
        "techniques[0]: no volumetric technique 'froxl' — did you mean 'froxel'?",
        "techniques[1].grid[0]: [1, 2] is not 3 whole numbers",
        "techniques[1].grid[1]: 0 is outside 1 … 1024",
        "techniques[1].gird: 'froxel' has no parameter 'gird' — did you mean 'grid'?",
        "techniques[2]: technique: is missing",
        "parameters.frox: no technique 'frox' — did you mean 'froxel'?",
        "parameters.taa.blend[1]: 2 is outside",
        "parameters.march: 7 is not an object",
        "tonemap: is an empty list",
        "truth.tagret: no such setting — did you mean 'target'?",
        "truth.depth: 1 is outside 2 … 64",
        "frames: -1 is outside 0 …",
        "trut: no such field — did you mean 'truth'?",
    ]
    for text in expected:
        assert sum(line.startswith(text) for line in found) == 1, (text, found)
    assert len(found) == len(expected)


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ([], "is not an object"),
        ({}, "scenes: is missing"),
        ({"scenes": []}, "scenes: is an empty list"),
        ({"scenes": "box", "parts": 3}, "parts: is not a list"),
        ({"scenes": "box", "parts": [3]}, "parts[0]: is not an object"),
        ({"parts": [{"scenes": "box"}, {}]}, "parts[1].scenes: is missing"),
        ({"parts": [{"scenes": "box"}, {"scenes": "bx"}]}, "parts[1].scenes: no scene 'bx' — did you mean 'box'?"),
        ({"scenes": "box", "parts": [{"parts": []}]}, "parts[0].parts: no such field"),
        ({"scenes": "box", "techniques": "off", "parameters": {"march": {}}}, "parameters.march: 'march' is not drawn"),
        ({"scenes": "box", "techniques": 3}, "techniques: 3 is neither the name of a technique nor an object"),
        ({"scenes": "box", "truth": "marsh"}, "truth: no judge 'marsh' — did you mean 'march'?"),
        ({"scenes": "box", "truth": {"judge": "march", "secnds": 1}}, "truth.secnds: no such setting"),
        ({"scenes": "box", "truth": {"judge": "none", "target": 1}}, "truth.target: is a setting of a judge, and"),
        ({"scenes": "box", "truth": {"judge": "traced", "filter": "box"}}, "truth: filter: the rays of still frames"),
        ({"scenes": "box", "metrics": "most"}, "metrics: 'most' is not one of 'all', 'light'"),
        ({"scenes": "box", "seed": 2**32}, "seed: 4294967296 is outside 0 … 4294967295"),
        ({"scenes": "box", "lights": True}, "lights: True is not a whole number"),
    ],
)
def test_one_mistake_is_one_line(spec: Any, said: str) -> None:
    (line,) = mistakes(spec)
    assert line.startswith(said)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"scenes": "box",\n  "lights": [1 2]}', "not JSON: line 2, column 16: "),
        ('{"scenes": "box", "scenes": "blinds"}', "the field 'scenes' is given twice"),
        ("[" * 100_000, "not JSON: nested too deeply"),
        ('{"scenes": "bx"}', "scenes: no scene 'bx'"),
        ("\udcff", "not JSON: not text in UTF-8"),
    ],
)
def test_a_file_is_named_with_its_mistake(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "spec.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(SweepError) as error:
        read(path)
    (line,) = error.value.mistakes
    assert line.startswith(f"{path}: {said}")


def test_the_specification_in_the_documentation_is_right() -> None:
    page = (Path(__file__).parents[3] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    block = re.search(r"```json\n(.*?)```", page, re.DOTALL)
    assert block
    spec = json.loads(block[1])
    assert len(plan({**spec, "scenes": "box"}).points) == 3 * 2 * 2 * (3 + 4)
    for name in sweep_spec._Record.model_fields:
        assert f"`{name}`" in page


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SweepError, match="nothing.json: cannot be read: No such file"):
        read(tmp_path / "nothing.json")


def test_a_product_without_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_spec, "_MOST_POINTS", 5)
    assert mistakes({"scenes": "box", "techniques": "off", "sizes": [[8, n] for n in range(8, 14)]}) == [
        "more than 5 points; measure them in several sweeps"
    ]
