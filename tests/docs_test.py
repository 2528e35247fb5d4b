"""The pages say what is so: links lead somewhere, and names and flags in them exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import tyndall
from tyndall.app import arguments
from tyndall.app.cli import main
from tyndall.lab import bundled
from tyndall.lab.truth import TruthSettings
from tyndall.techniques import FAMILIES

ROOT = Path(__file__).parents[1]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = [line.partition("  #")[0].strip() for line in README.splitlines() if line.startswith("tyndall ")]


def block(language: str) -> str:
    """The code of the README's block in a language."""
    found = re.search(rf"```{language}\n(.*?)```", README, re.DOTALL)
    assert found
    return found[1]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    missing = [t for t in targets if "://" not in t and not (page.parent / t).exists()]
    assert not missing


def test_the_readme_names_every_technique_and_scene() -> None:
    for family in FAMILIES.values():
        for name in family.members:
            assert f"`{name}`" in README
    words = " ".join(README.split())
    for name, triangles in bundled.TRIANGLES.items():
        assert f"`{name}` ({triangles or bundled.NODES[name]:,}" in words


def test_the_python_of_the_readme_uses_names_that_exist() -> None:
    code = block("python")
    compile(code, "README.md", "exec")
    used = set(re.findall(r"\bty\.(\w+)", code))
    assert used
    assert used <= set(tyndall.__all__)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_commands_of_the_readme_have_these_flags(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    _, *words = shlex.split(command)
    rest, flags = arguments.split_flags(words)
    members: dict[str, type] = {name: member for family in FAMILIES.values() for name, member in family.members.items()}
    if rest[0] == "compare":
        members["truth"] = TruthSettings
    arguments.convert_flags(flags, members)
    assert main([rest[0], "--help"]) == 0
    page = capsys.readouterr().out
    assert all(word in page for word in rest if word.startswith("--"))


def test_the_pictures_of_the_readme_are_light() -> None:
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", README)
    assert pictures
    assert sum((ROOT / picture).stat().st_size for picture in pictures) < 1_200_000
