"""The figures of ``tyndall bench sdf`` as Markdown tables, with the plain loop's and S5's own numbers beside them.

Every table is made from a result alone; what a result does not hold is not shown, or is a dash.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tyndall.lab import s5

Document = Mapping[str, Any]
Row = Mapping[str, Any]

GOALS = {
    "scene_times": 1.5,
    "scene_fps": 240.0,
    "times_at_1000": 5.0,
    "moving_fps": 60.0,
    "edit_ms": 1.0,
    "first_ms": 1000.0,
    "difference": 1e-4,
}
"""The project's goals: each scene over the plain loop and in frames a second; 1,000 primitives over the loop, and
10,000 moving in frames a second; host time of an edit; the first picture; pruned against whole values, in metres."""

_FIRST = {
    "new": "a new process, nothing kept",
    "kept": "a new process, the driver's cache warm",
    "running": "a program that draws already",
}


def markdown(document: Document) -> str:
    """All tables of a benchmark's document, or of as many parts as it has."""
    parts = [_head(document)]
    if document["adapter_type"] != "CPU":
        parts.append(_goals(document))
    made = {
        "scenes": _scenes,
        "swarm": _swarm,
        "edits": _edits,
        "first": _first,
        "agreement": _agreement,
        "peer": _peer,
        "failed": _failed,
    }
    parts += [table(document) for name, table in made.items() if document.get(name)]
    return "\n\n".join(parts) + "\n"


# --- the parts --------------------------------------------------------------------------------------------------------


def _head(document: Document) -> str:
    s, v = document["settings"], document["versions"]
    frame = ", ".join(f"{family} `{name}`" for family, name in s["frame"].items())
    width, height = s["size"]
    return "\n".join(
        [
            f"**{document['adapter']}**, {document['driver']}, {document['date']}; "
            f"Tyndall {v['tyndall']}, wgpu {v.get('wgpu', '?')}, Python {v['python']}.",
            "",
            f"{width}×{height} pixels; {frame}; medians over {s['seconds']:g} s of frames, {s['loop_seconds']:g} s of "
            "the plain loop's.",
        ]
    )


def _goals(document: Document) -> str:
    """The project's own goals, each against what was measured."""
    rows: list[list[str]] = []

    def goal(what: str, found: str, wanted: str, met: bool) -> None:
        rows.append([what, found, wanted, "yes" if met else "**no**"])

    for row in document.get("scenes", ()):
        loop, ours = fastest(row), frame_ms(row.get("ours", {}).get("still"))
        if loop and ours:
            times = loop[1] / ours
            wanted = GOALS["scene_times"]
            goal(f"`{row['scene']}` over the plain loop ({loop[0]})", _times(times), f"≥ {wanted:g}×", times >= wanted)
        for state in ("still", "moving"):
            if figures := row.get("ours", {}).get(state):
                fps, wanted = figures["fps"], GOALS["scene_fps"]
                goal(f"`{row['scene']}`, {state}, frames a second", f"{fps:,.0f}", f"≥ {wanted:g}", fps >= wanted)
    for row in document.get("swarm", ()):
        ours = row.get("ours", {})
        loop, still = fastest(row), frame_ms(ours.get("still"))
        if row["count"] == 1000 and loop and still:
            times, wanted = loop[1] / still, GOALS["times_at_1000"]
            goal(f"1,000 primitives over the plain loop ({loop[0]})", _times(times), f"≥ {wanted:g}×", times >= wanted)
        if row["count"] == 10_000 and ours.get("moving"):
            fps, wanted = ours["moving"]["fps"], GOALS["moving_fps"]
            goal("10,000 moving primitives, frames a second", f"{fps:,.0f}", f"≥ {wanted:g}", fps >= wanted)
    for name, row in document.get("edits", {}).get("rows", {}).items():
        if name != "nothing" and "edit_ms" in row:
            ms, wanted = row["edit_ms"]["median"], GOALS["edit_ms"]
            goal(f"move {name}, host" if "motion" not in name else f"{name}, host", f"{ms:.3f} ms", f"≤ {wanted:g} ms",
                 ms <= wanted)  # fmt: skip
    for row in document.get("first", ()):
        for kind, name in _FIRST.items():
            ms = row.get(kind, {}).get("first_ms")
            if ms is not None:
                wanted = GOALS["first_ms"]
                goal(f"first picture of `{row['scene']}`: {name}", f"{ms:,.0f} ms", f"≤ {wanted:,.0f} ms", ms <= wanted)
    for row in document.get("agreement", ()):
        for state in ("still", "moved"):
            if found := row.get(state):
                most = max(found["difference"], found["excess"])
                met = most <= GOALS["difference"] and not found["flipped"]
                what = f"`{row['scene']}`, {state}: pruned and whole values at {found['points']:,} points"
                goal(what, f"{most:.1e} m apart at most", f"≤ {GOALS['difference']:.0e} m", met)
    return f"### Goals\n\n{_table(['what', 'measured', 'goal', 'met'], rows)}"


def _scenes(document: Document) -> str:
    heading = ["scene", "nodes", "objects", "GPU ms", "moving", "host ms", "moving", "frames/s", "moving"]
    heading += ["loop, fragment, ms", "compute", "over the faster", "over the fragment", "S5's frames/s", "Shadertoy's"]
    rows = []
    passes: dict[str, dict[str, float]] = {}
    for row in document["scenes"]:
        ours = row.get("ours", {})
        states = [ours.get(state) for state in ("still", "moving")]
        still = frame_ms(states[0])
        loop, fragment = fastest(row), loop_ms(row.get("loop", {}).get("fragment"))
        theirs = s5.FPS.get(row["scene"])
        rows.append(
            [
                f"`{row['scene']}`",
                f"{row.get('nodes', 0):,}",
                str(row.get("objects", 0)),
                *(_ms(frame_ms(figures)) for figures in states),
                *(_ms(figures["host_ms"]["median"] if figures else None) for figures in states),
                *(f"{figures['fps']:,.0f}" if figures else "–" for figures in states),
                *(_loop(row.get("loop", {}).get(stage)) for stage in ("fragment", "compute")),
                _times(loop[1] / still if loop and still else None),
                _times(fragment / still if fragment and still else None),
                *(str(fps) for fps in theirs or ("–", "–")),
            ]
        )
        if states[0]:
            passes[row["scene"]] = states[0]["passes"]
    text = (
        "GPU and host time of our whole frame, still and in motion, and frames a second of a program that waits after "
        "each batch of frames. The plain loop is the same scene as literal code in one shader; in brackets the seconds "
        "that its compiler took. *Over* says how many times as fast our still frame is. S5's numbers, and Shadertoy's "
        f"beside them, are from another machine ({s5.ADAPTER}) and other models of the same subjects."
    )
    parts = ["### Scenes", text, _table(heading, rows)]
    if passes:
        names = list(dict.fromkeys(name for found in passes.values() for name in found))
        table = [[f"`{n}`", *(_ms(found.get(n)) for found in passes.values())] for n in names]
        parts += ["GPU milliseconds of our passes, still:", _table(["pass", *(f"`{s}`" for s in passes)], table)]
    return "\n\n".join(parts)


def _swarm(document: Document) -> str:
    heading = ["primitives", "GPU ms", "moving", "host ms", "moving", "frames/s", "moving"]
    heading += ["loop as code, fragment, ms", "compute", "as an array, fragment", "compute"]
    heading += ["still over the fastest", "moving over the array", "bytes a frame", "moving", "MiB"]
    rows = []
    for row in document["swarm"]:
        ours = row.get("ours", {})
        states = [ours.get(state) for state in ("still", "moving")]
        still, moving = (frame_ms(figures) for figures in states)
        loop, array = fastest(row), fastest(row, ("listed",))
        rows.append(
            [
                f"{row['count']:,}",
                *(_ms(frame_ms(figures)) for figures in states),
                *(_ms(figures["host_ms"]["median"] if figures else None) for figures in states),
                *(f"{figures['fps']:,.0f}" if figures else "–" for figures in states),
                *(
                    _loop(row.get(kind, {}).get(stage))
                    for kind in ("loop", "listed")
                    for stage in ("fragment", "compute")
                ),
                _times(loop[1] / still if loop and still else None),
                _times(array[1] / moving if array and moving else None),
                *(_bytes(ours.get(f"uploaded_{state}")) for state in ("still", "moving")),
                f"{sum(ours['memory'].values()) / 2**20:,.0f}" if "memory" in ours else "–",
            ]
        )
    text = (
        "Smooth-blended primitives. Code has a number for each and cannot move; a loop over an array can. Its smooth "
        "union is taken in order, ours by pairs. A star marks a time of a smaller picture, multiplied."
    )
    return f"### Swarm\n\n{text}\n\n{_table(heading, rows)}"


def _edits(document: Document) -> str:
    found = document["edits"]
    if "failed" in found:
        return f"### Edits\n\nNot measured: {found['failed']}"
    rows = [
        [
            name,
            *(_ms(row[key]["median"] if key in row else None, 3) for key in ("edit_ms", "draw_ms", "frame_ms")),
            _bytes(row.get("uploaded")),
        ]
        for name, row in found["rows"].items()
    ]
    heading = [
        "what moves",
        "host ms of the call",
        "host ms of the frame after it",
        "GPU ms of that frame",
        "bytes written",
    ]
    return f"### Edits\n\nIn `{found['scene']}`, {found['nodes']:,} nodes.\n\n{_table(heading, rows)}"


def _first(document: Document) -> str:
    heading = [
        "scene",
        "nodes",
        "where",
        "device ms",
        "scene ms",
        "first picture, ms",
        "until it is set up",
        "recorded",
        "slowest pipeline, ms",
        "the next renderer's, ms",
        "process ms",
    ]
    rows = []
    for row in document["first"]:
        for kind, name in _FIRST.items():
            if found := row.get(kind):
                keys = ("device_ms", "scene_ms", "first_ms", "setup_ms", "record_ms", "warm_ms", "process_ms")
                if "failed" in found:
                    cells = [found["failed"], *"–––––––"]
                else:
                    cells = [_ms(found.get(key), 0) for key in keys]
                    slowest = [f"{ms:,.0f} (`{label}`)" for label, ms in found.get("slowest", {}).items()]
                    cells.insert(5, ", ".join(slowest) or "–")
                rows.append([f"`{row['scene']}`", f"{row['nodes']:,}", name, *cells])
    text = (
        "From a scene and a device until a picture is there, the compiling of all pipelines in it; and the same again "
        "on the same device. Pipelines are built side by side, in as many threads as there are processors, while the "
        "first frame is recorded. A process also imports, makes its device and models the scene."
    )
    return f"### First picture\n\n{text}\n\n{_table(heading, rows)}"


def _agreement(document: Document) -> str:
    heading = [
        "scene",
        "state",
        "points",
        "in cells with a program",
        "largest difference there, m",
        "a ray is told more by, m",
    ]
    heading += ["other sign", "entries", "overflows"]
    rows = []
    for row in document["agreement"]:
        for state in ("still", "moved"):
            if found := row.get(state):
                rows.append(
                    [
                        f"`{row['scene']}`",
                        state,
                        f"{found['points']:,}",
                        f"{found['near']:,}",
                        f"{found['difference']:.1e}",
                        f"{found['excess']:.1e}",
                        str(found["flipped"]),
                        f"{row['cells']['entries']:,}",
                        str(row["cells"]["overflows"]),
                    ]
                )
    text = (
        "A cell's program against the whole one. What a ray is told may also be a bound, which must be of the same "
        "sign and no larger than the value. Half of the points are near the surfaces. *Entries* are instructions in "
        "the lists of all cells; *overflows*, cells that had to keep their parent's."
    )
    return f"### Pruned and whole values\n\n{text}\n\n{_table(heading, rows)}"


def _peer(document: Document) -> str:
    """Whole frames of wgpu-shadertoy by the clock."""
    peer = document["peer"]
    if "failed" in peer:
        return f"### Beside wgpu-shadertoy\n\nNot measured: {peer['failed']}"
    ours = {row["scene"]: row for row in [*document.get("scenes", ()), *document.get("swarm", ())]}
    rows = []
    for row in peer["scenes"]:
        ms = row["wall_ms"]["median"]
        still = ours.get(row["scene"], {}).get("ours", {}).get("still")
        rows.append(
            [f"`{row['scene']}`", _ms(ms), _ms(1000 / still["fps"]) if still else "–",
             _times(ms * still["fps"] / 1000 if still else None)]
        )  # fmt: skip
    rows += [[f"`{row['scene']}`", row["reason"], "–", "–"] for row in peer.get("failed_scenes", ())]
    text = (
        f"wgpu-shadertoy {peer.get('version', '?')} on {peer.get('adapter', '?')}: the plain loop's text in its "
        "fragment shader, compiled with wgpu's limits on loops; milliseconds of a whole frame by the clock, and ours."
    )
    return f"### Beside wgpu-shadertoy\n\n{text}\n\n{_table(['scene', 'ms', 'ours', 'over it'], rows)}"


def _failed(document: Document) -> str:
    rows = [[row["what"], row["reason"].replace("|", "\\|")] for row in document["failed"]]
    return f"### Not measured\n\n{_table(['what', 'why'], rows)}"


# --- figures ----------------------------------------------------------------------------------------------------------


def frame_ms(figures: Row | None) -> float | None:
    """GPU milliseconds of our whole frame."""
    return figures["frame_ms"]["median"] if figures else None


def loop_ms(found: Row | None) -> float | None:
    """GPU milliseconds of a plain loop that was measured."""
    return found["frame_ms"]["median"] if found and "frame_ms" in found else None


def fastest(row: Row, kinds: Sequence[str] = ("loop", "listed")) -> tuple[str, float] | None:
    """The plain loop's best way in a scene: its name and milliseconds."""
    found = [
        (f"{stage}, an array" if kind == "listed" else stage, ms)
        for kind in kinds
        for stage, figures in row.get(kind, {}).items()
        if (ms := loop_ms(figures))
    ]
    return min(found, key=lambda pair: pair[1]) if found else None


# --- cells ------------------------------------------------------------------------------------------------------------


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; all columns but the first are numbers."""
    rule = ["---" if i == 0 else "---:" for i in range(len(heading))]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (heading, rule, *rows))


def _ms(ms: float | None, digits: int | None = None) -> str:
    if ms is None:
        return "–"
    if digits is None:
        digits = 3 if ms < 1 else 2 if ms < 100 else 0
    return f"{ms:,.{digits}f}"


def _loop(found: Row | None) -> str:
    """A plain loop's cell."""
    if not found:
        return "–"
    ms = loop_ms(found)
    if ms is None:
        return str(found["failed"]) if len(str(found["failed"])) < 40 else "not measured"
    star = "*" if "measured_size" in found else ""
    compiled = f" ({found['compile_ms'] / 1000:.1f} s)" if "compile_ms" in found else ""
    return f"{_ms(ms)}{star}{compiled}"


def _times(times: float | None) -> str:
    return f"{times:.1f}×" if times is not None else "–"


def _bytes(count: int | None) -> str:
    return f"{count:,}" if count is not None else "–"
