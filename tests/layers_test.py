"""The layers of the design hold: an import goes down only, and one layer alone talks to the GPU."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import tyndall

ROOT = Path(tyndall.__file__).parent
# From the ground up. A module may import its own layer and those before it.
LAYERS = ("wesl", "gpu", "scene", "sdf", "simulation", "content", "tracing", "techniques", "frame", "lab", "app")
# An outside package that belongs to one layer.
OWNERS = {"wgpu": "gpu", "wesl": "gpu", "rendercanvas": "app", "typer": "app"}
MODULES = sorted(p for p in ROOT.rglob("*.py") if not p.name.endswith(("_test.py", "conftest.py")))


def layer_of(module: str) -> str | None:
    """The layer of a dotted module name; None for the package's own front door and its ``__main__``."""
    parts = module.split(".")
    return parts[1] if parts[0] == "tyndall" and len(parts) > 1 and parts[1] != "__main__" else None


def name_of(path: Path) -> str:
    parts = ("tyndall", *path.relative_to(ROOT).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(source: str, module: str, is_package: bool) -> Iterator[tuple[int, str]]:
    """Line and absolute dotted name of everything that ``source`` imports, wherever in the file it does so."""
    package = module.split(".") if is_package else module.split(".")[:-1]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            origin = ".".join([*base, *([node.module] if node.module else [])])
            # `from tyndall import lab` names a layer; `from tyndall.lab import compare` already has.
            names = [f"{origin}.{a.name}" for a in node.names] if origin == "tyndall" else [origin]
            yield from ((node.lineno, name) for name in names)


def violations(source: str, module: str, is_package: bool = False) -> list[str]:
    layer = layer_of(module)
    if layer is None:
        return []
    if layer not in LAYERS:
        return [f"{module}: '{layer}' is not a layer; add it to LAYERS at its height"]
    found = []
    for line, name in imports(source, module, is_package):
        target = layer_of(name)
        if target in LAYERS and LAYERS.index(target) > LAYERS.index(layer):
            found.append(f"{module}:{line} imports {name}: {layer} is below {target}")
        owner = OWNERS.get(name.split(".")[0])
        if owner not in (None, layer):
            found.append(f"{module}:{line} imports {name}, which is for tyndall.{owner} alone")
    return found


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_imports_go_down_only(path: Path) -> None:
    assert not violations(path.read_text(), name_of(path), path.name == "__init__.py")


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("tyndall.gpu.device", "from tyndall.scene.model import Scene"),
        ("tyndall.scene.files", "def f():\n    from tyndall import lab"),
        ("tyndall.scene.files", "from ..lab.compare import compare"),
        ("tyndall.techniques.volumetric.froxel", "import tyndall.frame"),
        ("tyndall.lab.compare", "import wgpu.utils"),
        ("tyndall.misc", ""),
    ],
)
def test_a_violation_is_found(module: str, source: str) -> None:
    assert len(violations(source, module)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("tyndall.lab.compare", "from tyndall.frame import Renderer\nfrom .measure import measure"),
        ("tyndall.gpu.device", "import wgpu"),
        ("tyndall.__main__", "from tyndall.app.cli import main"),
    ],
)
def test_a_downward_import_is_allowed(module: str, source: str) -> None:
    assert violations(source, module) == []
