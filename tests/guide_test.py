"""The guide to implicit surfaces is a program: its blocks run one after the other, but for those that draw."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import tyndall
from tyndall import sdf

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "implicit-surfaces.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_guide_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "guide"}
    # A snippet is read from its source, so that all of it is one file.
    blocks = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(blocks) > 8
    drawn = re.compile(r"^(ty\.render|with ty\.Renderer).*(\n    .*)*", re.MULTILINE)
    for block in blocks:
        compile(block, "implicit-surfaces.md", "exec")
    text = "\n".join(drawn.sub("", block) for block in blocks)
    exec(compile(text, "implicit-surfaces.md", "exec"), names)
    assert (tmp_path / "slice.png").stat().st_size > 0


def test_the_readme_models_and_draws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As printed, but for the pictures' size and number, and one of the two renderers."""
    monkeypatch.chdir(tmp_path)
    text = re.findall(r"```python\n(.*?)```", README, re.DOTALL)[1]
    text = re.sub(r"^ty\.render\(.*", "", text, flags=re.MULTILINE)
    exec(compile(text.replace("(640, 360)", "(16, 9)").replace("range(30)", "range(2)"), "README.md", "exec"), {})
    assert {path.name for path in tmp_path.iterdir()} == {"part.json", "slice.png"}


def test_the_guide_names_every_shape_and_method() -> None:
    tables = set(re.findall(r"`\.?(\w+)", "\n".join(line for line in PAGE.splitlines() if line.startswith("| "))))
    known = {name for name in dir(sdf) if not name.startswith("_")} | set(dir(sdf.Shape))
    assert tables <= known
    makers = {name for name in vars(sdf) if callable(getattr(sdf, name)) and name[0].islower()}
    elsewhere = {"union", "intersection", "subtraction", "from_mesh", "snippet"}
    unnamed = {
        n
        for n in makers - tables - elsewhere
        if getattr(sdf, n).__module__ in ("tyndall.sdf.solids", "tyndall.sdf.profiles")
    }
    assert not unnamed
    assert set(re.findall(r"\bty\.(\w+)", PAGE)) <= set(tyndall.__all__)
