"""Every example runs as it stands, is short, and leaves what it promises."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
LEAVES = {
    "first_light": ["first_light.exr", "first_light.png"],
    "compare_shadows": ["comparison"],
    "compare_techniques": ["comparison"],
    "own_scene": ["pyramid.json", "pyramid.png"],
    "orbit": ["orbit.webp"],
    "cost_of_lights": [],
    "soft_shadows": ["point.png", "bulb.png", "lantern.png"],
    "sweep_grids": ["sweep"],
    "model_part": ["part.png"],
    "field_slices": ["slice.png", "from_above.png", "gradient.png", "star.png"],
    "mesh_and_field": ["frame.json", "melted.png"],
    "own_distance": ["urchin.png"],
    "moving_drops": ["drops.webp"],
    "live_shapes": ["pillow.png"],
}


def test_every_example_is_known() -> None:
    assert {path.stem for path in EXAMPLES} == set(LEAVES)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example(path: Path, tmp_path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 25
    command = [sys.executable, "-W", "error", str(path)]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    assert result.returncode == 0, result.stderr
    left = {p.name for p in tmp_path.iterdir()}
    assert set(LEAVES[path.stem]) <= left
    for name in left:
        assert (tmp_path / name).stat().st_size > 0
