"""How much code a technique is: lines of Python and of shader that are neither blank, nor comment, nor docstring.

A technique's own code is its module and the ``.wesl`` of the same name, or all of its folder. What it stands on is
every module that those import, and that these import in turn, of the techniques, the tracing and the content: a shadow
by rays is a short file upon a tree that is a long one. What all techniques share (the contract, the drawing of
meshes, the pure functions of ``wesl/``) belongs to none of them. Tests do not count.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import tyndall
from tyndall.techniques.contract import Technique

_ROOT = Path(tyndall.__file__).parent
_COUNTED = ("techniques", "tracing", "content")
_SHARED = frozenset({"techniques/contract.py", "content/mesh.py", "content/mesh.wesl"})
_RAYS = _ROOT / "tracing" / "world.py"
_SILENT = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)


@dataclass(frozen=True)
class Lines:
    """Lines of code: ``host`` of Python, ``shader`` of WESL; ``below`` are those of what they stand on, both kinds."""

    host: int
    shader: int
    below: int

    def to_json(self) -> dict[str, int]:
        """Plain data."""
        return {"host": self.host, "shader": self.shader, "below": self.below}


def lines_of(technique: type[Technique]) -> Lines:
    """The lines of a technique."""
    own = _own(technique)
    below = _closure(own, rays=technique.casts_rays) - own
    count = {path: _count(path) for path in own | below}
    return Lines(
        host=sum(count[path] for path in own if path.suffix == ".py"),
        shader=sum(count[path] for path in own if path.suffix == ".wesl"),
        below=sum(count[path] for path in below),
    )


def python_lines(source: str) -> int:
    """Lines of Python that hold more than a comment or a docstring.

    >>> python_lines('"docstring"\\n\\n# comment\\nx = 1  # y\\ny = [\\n  x,\\n]\\n')
    4
    """
    documented: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        for statement in getattr(node, "body", ()) if not isinstance(node, (ast.Lambda, ast.IfExp)) else ():
            # A string that stands alone says what the name before it, or its function, is.
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                documented.update(range(statement.lineno, (statement.end_lineno or statement.lineno) + 1))
    said = {
        line
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type not in _SILENT
        for line in range(token.start[0], token.end[0] + 1)
    }
    return len(said - documented)


def shader_lines(source: str) -> int:
    """Lines of WESL that hold more than a comment.

    >>> shader_lines("// a\\n\\nfn f() { /* b\\n c */\\n}\\n")
    2
    """
    bare = re.sub(r"/\*.*?\*/", lambda found: "\n" * found.group().count("\n"), source, flags=re.DOTALL)
    return sum(bool(line.split("//")[0].strip()) for line in bare.splitlines())


def _count(path: Path) -> int:
    text = path.read_text(encoding="utf-8")
    return python_lines(text) if path.suffix == ".py" else shader_lines(text)


def _own(technique: type[Technique]) -> set[Path]:
    file = _file(technique.__module__)
    assert file is not None
    if file.name == "__init__.py" or file.parent.name == technique.name:
        return set(_sources(file.parent))
    return {file, *([shader] if (shader := file.with_suffix(".wesl")).exists() else [])}


def _sources(folder: Path) -> Iterator[Path]:
    for path in folder.iterdir():
        if path.suffix in (".py", ".wesl") and not path.stem.endswith("_test"):
            yield path


def _closure(own: Iterable[Path], *, rays: bool) -> set[Path]:
    """These files with all that they import, directly or not, of what is counted."""
    found: set[Path] = set()
    wanted = [*own, *([_RAYS] if rays else [])]
    while wanted:
        path = wanted.pop()
        if path in found:
            continue
        found.add(path)
        wanted += [p for p in _imported(path) if p.relative_to(_ROOT).as_posix() not in _SHARED]
    return found


def _imported(path: Path) -> Iterator[Path]:
    text = path.read_text(encoding="utf-8")
    for name in re.findall(r"\bpackage((?:::\w+)+)", text):
        parts = name.split("::")[1:]
        # The last names of a path may be of what a module holds.
        for end in range(len(parts), 0, -1):
            file = _ROOT.joinpath(*parts[:end]).with_suffix(".wesl")
            if parts[0] in _COUNTED and file.exists():
                yield file
                break
    for node in ast.parse(text).body if path.suffix == ".py" else ():
        if isinstance(node, ast.ImportFrom) and node.module:
            for module in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names)):
                source = _file(module)
                if source is None or source.relative_to(_ROOT).parts[0] not in _COUNTED:
                    continue
                if source.name != "__init__.py":
                    yield from (p for p in (source, source.with_suffix(".wesl")) if p.exists())


def _file(module: str) -> Path | None:
    parts = module.split(".")
    if parts[0] != "tyndall":
        return None
    base = _ROOT.joinpath(*parts[1:])
    return next((file for file in (base.with_suffix(".py"), base / "__init__.py") if file.exists()), None)
