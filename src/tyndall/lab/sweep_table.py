"""A sweep's rows for a terminal: what varies between its points, and what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyndall.lab.sweep_store import flat

if TYPE_CHECKING:
    from rich.table import Table

_MEASURING = frozenset({"frames", "warmup", "seconds", "seed", "metrics"})


def table(rows: Sequence[Mapping[str, Any]], notes: Sequence[str] = ()) -> Table:
    """One line a point, by rich. Names and reasons hold brackets that are no markup of rich's."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    points = [_point(row) for row in rows]
    varied = _varied(points)
    common = {name: value for name, value in (points[0] if points else {}).items() if name not in varied}
    title = Text(" · ".join(_text(common[name]) for name in ("scene", "size", "technique") if name in common))
    caption = Text("\n".join(notes), "table.caption")
    title.stylize("table.title")
    made = Table(title=title, caption=caption, caption_justify="left", box=box.SIMPLE_HEAD, padding=0)
    made.show_edge = False
    for name in varied:
        made.add_column(Text(name), no_wrap=True)
    for heading in ("GPU ms", "p95", "shadow ms", "frame ms", "host ms", "MiB", "L_v rel. RMSE", "bias"):
        made.add_column(heading, justify="right", no_wrap=True)
    for row, point in zip(rows, points, strict=True):
        own = [_text(point.get(name)) for name in varied]
        cells = [*own, *(_figures(row) if row["status"] == "done" else [row["status"], *7 * ["–"]])]
        made.add_row(*map(Text, cells))
    return made


def _point(row: Mapping[str, Any]) -> dict[str, Any]:
    """What a point is, flat; its measuring left out."""
    plain = flat({"point": row["point"]})
    width, height = plain.pop("width"), plain.pop("height")
    named = {"scene": Path(str(plain.pop("scene"))).name, "lights": plain.pop("lights"), "size": f"{width}×{height}"}
    return {**named, **{name: value for name, value in plain.items() if name not in _MEASURING}}


def _varied(points: Sequence[Mapping[str, Any]]) -> list[str]:
    """The names whose values differ between points that have them; the technique's always, where there is one point."""
    names = dict.fromkeys(name for point in points for name in point)
    found = []
    for name in names:
        values = {str(point[name]) for point in points if name in point}
        if len(values) > 1:
            found.append(name)
    return found or ["technique"]


def _figures(row: Mapping[str, Any]) -> list[str]:
    light = (row.get("errors") or {}).get("inscattered", {})
    gpu, shadow, frame, host = (row.get(name) or {} for name in ("gpu_ms", "shadow_ms", "frame_ms", "host_ms"))
    error = light.get("rel_rmse_corrected", light.get("rel_rmse"))
    return [
        _ms(gpu.get("median")),
        _ms(gpu.get("p95")),
        *(_ms(times.get("median")) for times in (shadow, frame, host)),
        f"{row['memory_bytes'] / 2**20:.2f}",
        "–" if error is None else f"{100 * error:.2f} %",
        "–" if light.get("bias") is None else f"{100 * light['bias']:+.2f} %",
    ]


def _ms(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}" if value < 10 else f"{value:.1f}"


def _text(value: Any) -> str:
    return "–" if value is None else str(value)
