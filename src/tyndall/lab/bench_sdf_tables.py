"""The figures of ``tyndall bench sdf`` as Markdown tables, with the plain loop's and S5's own numbers beside them.

Every table is made from a result alone. What failed stands in its place with its reason, and again at the end, where
parts are named as well that the result does not have.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
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

PARTS = {
    "scenes": "ours in the scenes",
    "swarm": "ours in the swarms",
    "edits": "edits",
    "first": "first pictures",
    "agreement": "pruned and whole values",
    "loops": "the plain loops",
    "peer": "wgpu-shadertoy",
}
"""What a result may have, in words."""

_FIRST = {
    "new": "a new process, nothing kept",
    "kept": "a new process, the driver's cache warm",
    "running": "a program that draws already",
}
_STAGES = ("fragment", "compute")
_STATES = ("still", "moving")
_LONG = 30  # letters of a reason; a longer one stands at the end only
_SHORT_MS = 0.05  # passes that never take as long are added up


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
    }
    parts += [table(document) for name, table in made.items() if document.get(name)]
    if missing := [(what, why) for what, why in (*failures(document), *absent(document))]:
        rows = [[what, why.replace("|", "\\|")] for what, why in missing]
        parts.append(f"### Not measured\n\n{_table(['what', 'why'], rows)}")
    return "\n\n".join(parts) + "\n"


# --- what there is not ------------------------------------------------------------------------------------------------


def parts_of(document: Document) -> list[str]:
    """Which of :data:`PARTS` a document has, also where they failed."""
    rows = [*document.get("scenes", ()), *document.get("swarm", ())]
    found = {name for name in ("edits", "first", "agreement", "peer") if document.get(name)}
    found |= {name for name in ("scenes", "swarm") if any("ours" in row for row in document.get(name, ()))}
    if any("loop" in row or "listed" in row for row in rows):
        found.add("loops")
    return [name for name in PARTS if name in found]


def absent(document: Document) -> Iterator[tuple[str, str]]:
    """The parts that a document does not have, and why."""
    have = parts_of(document)
    return ((what, "not in this run") for name, what in PARTS.items() if name not in have)


def failures(document: Document) -> Iterator[tuple[str, str]]:
    """All that failed and why, from the figures themselves: of runs that were joined, the last word is there."""
    for row in (*document.get("scenes", ()), *document.get("swarm", ())):
        if "failed" in row.get("ours", {}):
            yield f"`{row['scene']}`", row["ours"]["failed"]
        for kind, how in (("loop", "code"), ("listed", "an array")):
            for stage, found in row.get(kind, {}).items():
                if "failed" in found:
                    yield f"the plain loop in `{row['scene']}` as {how}, {stage}", _reason(found)
    if "failed" in document.get("edits", {}):
        yield f"edits of `{document['edits']['scene']}`", document["edits"]["failed"]
    for row in document.get("first", ()):
        if "failed" in row:
            yield f"first picture of `{row['scene']}`", row["failed"]
        for kind, where in _FIRST.items():
            if "failed" in row.get(kind, {}):
                yield f"first picture of `{row['scene']}` in {where}", row[kind]["failed"]
    for row in document.get("agreement", ()):
        if "failed" in row:
            yield f"pruned and whole values of `{row['scene']}`", row["failed"]
    if "failed" in document.get("peer", {}):
        yield PARTS["peer"], document["peer"]["failed"]


def _reason(found: Row) -> str:
    """Why a loop has no time, and how long its compiler took where that is known."""
    compiled = f" (compiled in {found['compile_ms'] / 1000:.1f} s)" if "compile_ms" in found else ""
    return f"{found['failed']}{compiled}"


# --- the parts --------------------------------------------------------------------------------------------------------


def _head(document: Document) -> str:
    s, v = document["settings"], document["versions"]
    frame = ", ".join(f"{family} `{name}`" for family, name in s["frame"].items())
    width, height = s["size"]
    runs = document.get("runs", (document,))
    lines = [
        f"**{document['adapter']}**, {document['driver']}, {_least_most([run['date'] for run in runs])}; "
        f"Tyndall {v['tyndall']}, wgpu {v.get('wgpu', '?')}, Python {v['python']}.",
        "",
        f"{width}×{height} pixels; {frame}; medians over {_span(runs, 'seconds')} s of frames, "
        f"{_span(runs, 'loop_seconds')} s of the plain loop's.",
    ]
    if document["adapter_type"] == "CPU":
        late = "A software adapter may stamp the beginning of a frame's only pass late"
        lines += ["", f"{late}: the compute loop can seem to take no time at all."]
    if len(runs) > 1:
        told = [
            f"{', '.join(PARTS[part] for part in run['parts']) or 'nothing'} ({run['settings']['seconds']:g} s)"
            for run in runs
        ]
        lines += ["", f"Measured in {len(runs)} runs: {'; '.join(told)}. Of what several have, the last one's is here."]
    return "\n".join(lines)


def _span(runs: Sequence[Document], key: str) -> str:
    return _least_most([f"{seconds:g}" for seconds in sorted(run["settings"][key] for run in runs)])


def _least_most(sorted_texts: Sequence[str]) -> str:
    return sorted_texts[0] if sorted_texts[0] == sorted_texts[-1] else f"{sorted_texts[0]} to {sorted_texts[-1]}"


def _goals(document: Document) -> str:
    """The project's own goals, each against what was measured, or why it was not."""
    rows: list[list[str]] = []

    def goal(what: str, found: str, wanted: str, met: bool | None) -> None:
        rows.append([what, found, wanted, {True: "yes", False: "**no**", None: "**not known**"}[met]])

    def over_the_loop(what: str, row: Row, wanted: float) -> None:
        loop, still = fastest(row), frame_ms(row.get("ours", {}).get("still"))
        if loop and still:
            name, times = loop[0], loop[1] / still
            goal(f"{what} over the plain loop ({name})", _times(times), f"≥ {wanted:g}×", times >= wanted)
        else:
            goal(f"{what} over the plain loop", _no_ratio(row), f"≥ {wanted:g}×", None)

    def per_second(what: str, row: Row, state: str, wanted: float) -> None:
        if figures := row.get("ours", {}).get(state):
            goal(what, _fps(figures), f"≥ {wanted:g}", figures["fps"] >= wanted)
        elif "still" not in row.get("ours", {}):
            goal(what, "not measured", f"≥ {wanted:g}", None)

    for row in document.get("scenes", ()):
        over_the_loop(f"`{row['scene']}`", row, GOALS["scene_times"])
        for state in _STATES:
            per_second(f"`{row['scene']}`, {state}, frames a second", row, state, GOALS["scene_fps"])
    for row in document.get("swarm", ()):
        if row["count"] == 1000:
            over_the_loop("1,000 primitives", row, GOALS["times_at_1000"])
        if row["count"] == 10_000:
            per_second("10,000 moving primitives, frames a second", row, "moving", GOALS["moving_fps"])
    for name, row in document.get("edits", {}).get("rows", {}).items():
        if name != "nothing" and "edit_ms" in row:
            ms, wanted = row["edit_ms"]["median"], GOALS["edit_ms"]
            goal(f"move {name}, host" if "motion" not in name else f"{name}, host", f"{ms:.3f} ms", f"≤ {wanted:g} ms",
                 ms <= wanted)  # fmt: skip
    for row in document.get("first", ()):
        for kind, name in _FIRST.items():
            if found := row.get(kind):
                wanted, what = GOALS["first_ms"], f"first picture of `{row['scene']}`: {name}"
                ms = found.get("first_ms")
                told = f"{ms:,.0f} ms" if ms is not None else _short(found)
                goal(what, told, f"≤ {wanted:,.0f} ms", ms <= wanted if ms is not None else None)
    for row in document.get("agreement", ()):
        for state in ("still", "moved"):
            if found := row.get(state):
                most = max(found["difference"], found["excess"])
                met = most <= GOALS["difference"] and not found["flipped"]
                what = f"`{row['scene']}`, {state}: pruned and whole values at {found['points']:,} points"
                told = f"{most:.1e} m apart at most" if most else "equal in every bit"
                goal(what, told, f"≤ {GOALS['difference']:.0e} m", met)
    return f"### Goals\n\n{_table(['what', 'measured', 'goal', 'met'], rows)}"


def _no_ratio(row: Row) -> str:
    """Why nobody can say how many times as fast ours is."""
    if "still" not in row.get("ours", {}):
        return "ours was not measured"
    reasons = {stage: _short(found) for stage, found in row.get("loop", {}).items()}
    if not reasons:
        return "the loop was not measured"
    if len(set(reasons.values())) == 1:
        return next(iter(reasons.values()))
    return "; ".join(f"{stage}: {reason}" for stage, reason in reasons.items())


def _scenes(document: Document) -> str:
    heading = ["scene", "nodes", "objects", *_OURS, "S5's frames/s", "Shadertoy's"]
    rows, loops = [], []
    for row in document["scenes"]:
        theirs = s5.FPS.get(row["scene"])
        rows.append(
            [
                f"`{row['scene']}`",
                f"{row['nodes']:,}" if "nodes" in row else "–",
                str(row.get("objects", "–")),
                *_figures(row.get("ours", {}), GOALS["scene_fps"]),
                *(str(fps) for fps in theirs or ("–", "–")),
            ]
        )
        still = frame_ms(row.get("ours", {}).get("still"))
        ways = [row.get("loop", {}).get(stage) for stage in _STAGES]
        best = fastest(row, ("loop",))
        loops.append(
            [f"`{row['scene']}`", _ms(still), *map(_loop, ways), *(_ratio(loop_ms(found), still) for found in ways),
             _ratio(best[1] if best else None, still)]
        )  # fmt: skip
    text = (
        "Our whole frame, still and in motion: frames a second of a program that waits after each batch of frames, GPU "
        f"and host time. Bold: below {GOALS['scene_fps']:g} frames a second. S5's numbers, and Shadertoy's beside "
        f"them, are from another machine ({s5.ADAPTER}) and other models of the same subjects."
    )
    parts = ["### Scenes", text, _table(heading, rows)]
    slow = [line for row in document["scenes"] for line in _why_slow(row)]
    if slow:
        parts.append("\n".join([f"Below {GOALS['scene_fps']:g} frames a second:", "", *(f"- {s}" for s in slow)]))
    if any("loop" in row for row in document["scenes"]):
        heading = ["scene", "ours, still, ms", "loop, fragment, ms", "loop, compute, ms"]
        heading += ["ours over the fragment", "over compute", "over the faster"]
        text = (
            "GPU time of our whole frame beside that of the plain loop, the same scene as literal code in one shader. "
            f"In brackets the seconds that its compiler took{_star_text(document['scenes'])}. *Over*: how many times "
            "as fast ours is."
        )
        parts += [text, _table(heading, loops)]
    parts += [*_passes(document["scenes"]), *_memory(document["scenes"])]
    return "\n\n".join(parts)


def _swarm(document: Document) -> str:
    rows, loops = [], []
    for row in document["swarm"]:
        ours = row.get("ours", {})
        wanted = GOALS["moving_fps"] if row["count"] == 10_000 else 0.0
        nodes = f"{row['nodes']:,}" if "nodes" in row else "–"
        rows.append([f"{row['count']:,}", nodes, *_figures(ours, wanted, states=("moving",))])
        still, moving = (frame_ms(ours.get(state)) for state in _STATES)
        best, array = fastest(row), fastest(row, ("listed",))
        ways = [row.get(kind, {}).get(stage) for kind in ("loop", "listed") for stage in _STAGES]
        loops.append(
            [f"{row['count']:,}", _ms(still), _ms(moving), *map(_loop, ways),
             _ratio(best[1] if best else None, still), _ratio(array[1] if array else None, moving)]
        )  # fmt: skip
    text = "Our whole frame of so many smooth-blended primitives, still and all moving."
    if any(row["count"] == 10_000 for row in document["swarm"]):
        text += f" Bold: of 10,000 in motion, below {GOALS['moving_fps']:g} frames a second."
    parts = [f"### Swarm\n\n{text}", _table(["primitives", "nodes", *_OURS], rows)]
    if any("loop" in row or "listed" in row for row in document["swarm"]):
        heading = ["primitives", "ours, still, ms", "moving", "loop as code, fragment, ms", "compute"]
        heading += ["as an array, fragment", "compute", "still over the fastest", "moving over the array"]
        text = (
            "Beside the plain loop: code has a number for each primitive and cannot move; a loop over an array of them "
            f"can. Its smooth union is taken in order, ours by pairs{_star_text(document['swarm'])}."
        )
        parts += [text, _table(heading, loops)]
    parts += [*_passes(document["swarm"]), *_memory(document["swarm"])]
    return "\n\n".join(parts)


# --- tables that scenes and swarms have both --------------------------------------------------------------------------

_OURS = ["still, frames/s", "moving, frames/s", "still, GPU ms", "moving, GPU ms", "still, host ms", "moving, host ms"]


def _figures(ours: Row, wanted: float, states: Sequence[str] = _STATES) -> list[str]:
    """The cells of :data:`_OURS`; frames per second below ``wanted`` in bold."""
    if "failed" in ours:
        return [_short(ours), *"–––––"]
    both = [ours.get(state) for state in _STATES]
    fps = [
        "–" if not found else f"**{_fps(found)}**" if found["fps"] < wanted and state in states else _fps(found)
        for state, found in zip(_STATES, both, strict=True)
    ]  # fmt: skip
    hosts = [_ms(found["host_ms"]["median"] if found else None) for found in both]
    return [*fps, *(_ms(frame_ms(found)) for found in both), *hosts]


def _why_slow(row: Row) -> Iterator[str]:
    """For each state that is too slow, what it waits for."""
    for state in _STATES:
        figures = row.get("ours", {}).get(state)
        if not figures or figures["fps"] >= GOALS["scene_fps"]:
            continue
        gpu, host = figures["frame_ms"]["median"], figures["host_ms"]["median"]
        begin = f"`{row['scene']}`, {state}, {_fps(figures)}"
        if host > gpu:
            yield f"{begin}: waits for the host, {_ms(host)} ms a frame; the GPU takes {_ms(gpu)}"
        else:
            most = sorted(figures["passes"].items(), key=lambda pair: -pair[1])[:3]
            told = ", ".join(f"`{name}` {_ms(ms)}" for name, ms in most)
            yield f"{begin}: {_ms(gpu)} ms on the GPU, of which {told}"


def _passes(rows: Sequence[Row]) -> list[str]:
    """GPU times of our passes, of scenes that move in motion."""
    found: dict[str, Row] = {}
    for row in rows:
        ours = row.get("ours", {})
        if figures := ours.get("moving") or ours.get("still"):
            found[row["scene"]] = figures["passes"]
    if not found:
        return []
    names = list(dict.fromkeys(name for passes in found.values() for name in passes))
    seen = [name for name in names if any(passes.get(name, 0.0) >= _SHORT_MS for passes in found.values())]
    table = [[f"`{name}`", *(_ms(passes.get(name)) for passes in found.values())] for name in seen]
    if rest := [name for name in names if name not in seen]:
        sums = (sum(passes.get(name, 0.0) for name in rest) for passes in found.values())
        table.append([f"{len(rest)} more", *map(_ms, sums)])
    return ["GPU milliseconds of our passes, in motion:", _table(["pass", *(f"`{scene}`" for scene in found)], table)]


def _memory(rows: Sequence[Row]) -> list[str]:
    """What scenes hold on the device, and what is written to it for a frame."""
    table = []
    for row in rows:
        ours = row.get("ours", {})
        if "memory" in ours:
            memory = ours["memory"]
            sizes = (memory.get("implicit", 0), sum(memory.values()))
            written = (_bytes(ours.get(f"uploaded_{state}")) for state in _STATES)
            table.append([f"`{row['scene']}`", *(f"{size / 2**20:,.1f}" for size in sizes), *written])
    heading = ["scene", "MiB of the shapes", "MiB of all", "bytes written for a frame, still", "moving"]
    return ["Memory on the device, and what a frame writes to it:", _table(heading, table)] if table else []


def _star_text(rows: Sequence[Row]) -> str:
    """What the star beside some loops' times means."""
    sizes = {
        tuple(found["measured_size"])
        for row in rows
        for kind in ("loop", "listed")
        for found in row.get(kind, {}).values()
        if "measured_size" in found
    }
    told = " or ".join(f"{width}×{height}" for width, height in sorted(sizes))
    return f"; a star marks a time of a picture of {told}, multiplied by the pixels" if sizes else ""


# --- other parts ------------------------------------------------------------------------------------------------------


def _edits(document: Document) -> str:
    found = document["edits"]
    if "failed" in found:
        return f"### Edits\n\nNot measured: {found['failed']}"
    keys = ("edit_ms", "draw_ms", "frame_ms")
    rows = []
    for name, row in found["rows"].items():
        call, draw, frame = (_ms(row[key]["median"] if key in row else None, 3) for key in keys)
        late = name != "nothing" and "edit_ms" in row and row["edit_ms"]["median"] > GOALS["edit_ms"]
        rows.append([name, f"**{call}**" if late else call, draw, frame, _bytes(row.get("uploaded"))])
    heading = [
        "what moves",
        "host ms of the call",
        "host ms of the frame after it",
        "GPU ms of that frame",
        "bytes written",
    ]
    text = f"In `{found['scene']}`, {found['nodes']:,} nodes. Bold: a call of more than {GOALS['edit_ms']:g} ms."
    return f"### Edits\n\n{text}\n\n{_table(heading, rows)}"


def _first(document: Document) -> str:
    keys = {
        "import_ms": "import ms",
        "device_ms": "device ms",
        "scene_ms": "scene ms",
        "first_ms": "first picture, ms",
        "setup_ms": "of it until there is a renderer",
        "record_ms": "recording its frame",
        "link_ms": "linking, of all pipelines together",
        "modules_ms": "modules",
        "pipelines_ms": "the driver's compiler",
        "pipelines": "pipelines",
        "warm_ms": "the next renderer's, ms",
        "process_ms": "process ms",
    }
    known = [key for key in keys if any(key in row.get(kind, {}) for row in document["first"] for kind in _FIRST)]
    known = known or ["first_ms"]
    heading = ["scene", "nodes", "where", *(keys[key] for key in known)]
    rows = []
    for row in document["first"]:
        nodes = f"{row['nodes']:,}" if "nodes" in row else "–"
        for kind, name in _FIRST.items():
            if found := row.get(kind, row if "failed" in row else None):
                cells = [_ms(found.get(key), 0) for key in known]
                if "failed" in found:
                    cells = [_short(found), *"–" * (len(known) - 1)]
                rows.append([f"`{row['scene']}`", nodes, name, *cells])
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
        if "failed" in row:
            rows.append([f"`{row['scene']}`", _short(row), *"–" * (len(heading) - 2)])
        for state in ("still", "moved"):
            if found := row.get(state):
                rows.append(
                    [
                        f"`{row['scene']}`",
                        state,
                        f"{found['points']:,}",
                        f"{found['near']:,}",
                        f"{found['difference']:.1e}" if found["difference"] else "0",
                        f"{found['excess']:.1e}" if found["excess"] else "0",
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


def _fps(figures: Row) -> str:
    return f"{figures['fps']:,.{0 if figures['fps'] >= 10 else 1}f}"


def _loop(found: Row | None) -> str:
    """A plain loop's cell."""
    if not found:
        return "–"
    ms = loop_ms(found)
    if ms is None:
        return _short(found)
    star = "*" if "measured_size" in found else ""
    compiled = f" ({found['compile_ms'] / 1000:.1f} s)" if "compile_ms" in found else ""
    return f"{_ms(ms)}{star}{compiled}"


def _short(found: Row) -> str:
    """Why there is no figure, as far as a cell has room."""
    reason = str(found["failed"]) if "failed" in found else "not measured"
    return reason if len(reason) <= _LONG else "failed, see the end"


def _ratio(slow: float | None, fast: float | None) -> str:
    return _times(slow / fast if slow and fast else None)


def _times(times: float | None) -> str:
    return f"{times:.1f}×" if times is not None else "–"


def _bytes(count: int | None) -> str:
    return f"{count:,}" if count is not None else "–"
