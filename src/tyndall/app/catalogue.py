"""The lists that a person chooses from, out of the declarations themselves: techniques with parameters, and scenes."""

from __future__ import annotations

import inspect
from dataclasses import MISSING
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol

from tyndall.gpu.params import Field, ParameterError, describe_range, describe_type, fields_of, nearest

if TYPE_CHECKING:
    from rich.console import RenderableType


class Listed(Protocol):
    """What a technique says of itself, and so does the marching of rays, which has parameters as they have."""

    name: ClassVar[str]
    paper: ClassVar[str]
    advice: ClassVar[str]
    receivers: ClassVar[Literal["all", "planes"]]


def find_techniques(name: str | None = None) -> list[tuple[str, type[Listed]]]:
    """(family, technique) of every technique, of one family, or of one technique's name; the marching of rays through
    implicit surfaces is listed last, a family of its own.

    Raises:
        ParameterError: neither a family nor a technique; the nearest right name is offered.
    """
    from tyndall.sdf.marching import Marching
    from tyndall.techniques import FAMILIES

    every: list[tuple[str, type[Listed]]] = [
        (family.name, member) for family in FAMILIES.values() for member in family.members.values()
    ]
    every.append((Marching.name, Marching))
    if name is None:
        return every
    wanted = name.replace("-", "_")
    found = [pair for pair in every if wanted in (pair[0], pair[1].name)]
    if not found:
        known = [*FAMILIES, *(member.name for _, member in every)]
        raise ParameterError(f"no technique or family '{name}'{nearest(wanted, known)}")
    return found


def technique_json(family: str, technique: type[Listed]) -> dict[str, Any]:
    """Everything that a technique declares, as plain data."""
    return {
        "family": family,
        "name": technique.name,
        "summary": summary(technique),
        "paper": technique.paper,
        "advice": technique.advice,
        "receivers": technique.receivers,
        "parameters": [
            {
                "name": f.name,
                "flag": f"--{technique.name}.{f.name}",
                "type": describe_type(f.type),
                "default": None if f.default is MISSING else f.default,
                "low": f.param.low,
                "high": f.param.high,
                "unit": f.param.unit,
                "meaning": f.param.doc,
                "rebuild": f.param.rebuild,
            }
            for f in fields_of(technique)
        ],
    }


def techniques_table(techniques: list[tuple[str, type[Listed]]]) -> RenderableType:
    """One paragraph and one table of parameters a technique, under its family's heading."""
    from rich.console import Group
    from rich.markup import escape
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    parts: list[RenderableType] = []
    heading = ""
    for family, technique in techniques:
        if family != heading:
            heading = family
            parts.append(Text(family, style="bold underline"))
        name = technique.name
        about = [f"[bold cyan]{name}[/]  {escape(summary(technique))}"]
        about += [escape(technique.advice)]
        if technique.receivers == "planes":
            about += ["Receivers: flat surfaces only; what is not on one of the planes that it serves is lit."]
        about += [f"[dim]Paper: {escape(technique.paper)}[/]"]
        parts.append(Padding(Text.from_markup("\n".join(about)), (0, 0, 0, 2)))
        if fields := fields_of(technique):
            table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
            table.add_column(no_wrap=True)
            table.add_column(no_wrap=True)
            for f in fields:
                table.add_row(
                    f"[green]--{name}.{f.name}[/]",
                    escape(show(f.default)),
                    escape(allowed(f)),
                    f.param.unit,
                    escape(f.param.doc),
                )
            parts.append(Padding(table, (0, 0, 0, 4)))
        parts.append(Text())
    return Group(*parts[:-1])


def summary(item: Any) -> str:
    """The first sentence or line of a docstring."""
    return (inspect.getdoc(item) or "").partition("\n\n")[0].replace("\n", " ")


def show(value: Any) -> str:
    """A parameter's value as a command line takes it."""
    if value is MISSING:
        return "required"
    if isinstance(value, tuple):
        return ",".join(show(v) for v in value)
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def allowed(f: Field) -> str:
    """Type and range of a parameter in words: ``3 whole numbers, 1 … 1024``."""
    ranges = describe_range(f.param)
    return describe_type(f.type) if ranges == "any" else f"{describe_type(f.type)}, {ranges}"


def scenes_json() -> list[dict[str, Any]]:
    """The bundled scenes, as plain data; none of them is built."""
    from tyndall.lab import bundled

    return [
        {
            "name": name,
            "triangles": bundled.TRIANGLES[name],
            "nodes": bundled.NODES[name],
            "summary": summary(make),
        }
        for name, make in bundled.SCENES.items()
    ]


def scenes_table(scenes: list[dict[str, Any]]) -> RenderableType:
    """One line a scene."""
    from rich.table import Table

    table = Table("scene", "triangles", "nodes", "what it is", box=None, padding=(0, 2, 0, 0), header_style="bold")
    for column in table.columns[1:3]:
        column.justify = "right"
    for scene in scenes:
        counts = (f"{scene[kind]:,}" if scene[kind] else "" for kind in ("triangles", "nodes"))
        table.add_row(f"[cyan]{scene['name']}[/]", *counts, scene["summary"])
    return table
