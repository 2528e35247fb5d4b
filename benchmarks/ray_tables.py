"""Tables of what ``benchmarks/rays.py`` and ``benchmarks/truth.py`` printed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any


def rays(document: dict[str, Any]) -> str:
    """The tree's build, and rays a second."""
    heading = ["scene", "triangles", "in the tree", "build ms", "on the GPU", "MiB"]
    heading += [f"{kind}, million/s" for kind in ("primary", "shadow", "scattered")]
    rows = [
        [
            row["scene"],
            f"{row['triangles']:,}",
            f"{row['in_tree']:,}",
            f"{row['build_ms']:.1f}",
            f"{row['build_passes_ms']['frame']:.1f}",
            f"{row['bytes'] / 2**20:.0f}",
            *(f"{row[kind]['per_second'] / 1e6:,.0f}" for kind in ("primary", "shadow", "scattered")),
        ]
        for row in document["rows"]
    ]
    return f"{_machine(document)}\n\n{_table(heading, rows)}"


def truth(document: dict[str, Any]) -> str:
    """How soon a truth is good enough, Mitsuba's beside it, and rays in a frame."""
    width, height = document["size"]
    target = 100 * document["target"]
    parts = [_machine(document), f"Pictures of {width}×{height}, to a relative standard error of {target:g} %."]
    heading = [
        "scene",
        "judge",
        "samples a pixel",
        "seconds",
        "error of the picture",
        "error of `L_v`",
        "with set-up, s",
    ]
    rows = []
    for scene, found in document["truth"].items():
        rows.append([*_judged(scene, found), f"{found['warm']:.2f} ({found['first']:.1f} the first time)"])
        for other in document.get("mitsuba", {}).get(scene, []):
            if "failed" in other:
                rows.append([scene, other["variant"], "–", "–", "–", "–", other["failed"]])
            else:
                rows.append([*_judged(scene, other), f"{other['whole']:.1f}"])
    parts.append(_table(heading, rows))
    if document.get("shadows"):
        heading = ["scene", "shadows", "lights", "GPU ms", "ambient occlusion, GPU ms"]
        rows = [
            [
                row["scene"],
                f"`{row['shadow']}`",
                "soft" if row["soft"] else "punctual",
                f"{row['gpu_ms']['median']:.3f}",
                f"{row['occlusion_ms']['median']:.3f}" if row["occlusion_ms"] else "–",
            ]
            for row in document["shadows"]
        ]
        width, height = document["frame"]
        parts += [f"Shadows of one light at {width}×{height}, and ambient occlusion:", _table(heading, rows)]
    return "\n\n".join(parts)


def _judged(scene: str, found: dict[str, Any]) -> list[str]:
    errors = [found["error"][kind] for kind in ("radiance", "inscattered")]
    written = ["–" if error == float("inf") else f"{100 * error:.2f} %" for error in errors]
    return [scene, found["judge"], f"{found['samples']:,}", f"{found['seconds']:.2f}", *written]


def _machine(document: dict[str, Any]) -> str:
    return f"**{document['adapter']}**, {document['driver']}, {document['date']}."


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heading, ["---"] + ["---:"] * (len(heading) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
