"""The benchmark's figures as Markdown tables, with S1's own figures beside them.

S1 published frames per second with and without each technique on an RTX 4060 Laptop; the time of a technique is then
``1000/fps − 1000/fps_off``. That is another machine and another base image: its column shows the order of magnitude and
the trend, not a race.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

# S1, table 6: frames per second on an RTX 4060 Laptop, by this project's scene of the same character.
S1_FPS = {
    "box": {"off": 156, "froxel": 136, "screen_space": 119, "polygonal": 116},
    "blinds": {"off": 103, "froxel": 94, "screen_space": 83, "polygonal": 68},
    "courtyard": {"off": 46, "froxel": 44, "screen_space": 43, "polygonal": 34},
}
S1_MACHINE = "RTX 4060 Laptop"


def s1_milliseconds(scene: str, technique: str) -> float | None:
    """What S1's technique added to its frame, in ms; None where it has no such figure."""
    fps = S1_FPS.get(scene, {})
    if technique == "off" or technique not in fps:
        return None
    return 1000 / fps[technique] - 1000 / fps["off"]


def markdown(document: Mapping[str, Any]) -> str:
    """All tables of a benchmark's document, or of as many parts as it has yet."""
    parts = [_head(document)]
    if "scenes" in document:
        if document["adapter_type"] != "CPU" and document["settings"]["size"] == [2134, 1459]:
            parts.append(_goals(document))
        parts += [_scenes(document), _memory(document)]
    if "lights" in document:
        parts.append(_lights(document))
    if "resolution" in document:
        parts += [_resolution(name, found) for name, found in document["resolution"].items()]
    return "\n\n".join(parts) + "\n"


def comparison(document: Mapping[str, Any]) -> str:
    """The table of a ``results.json`` of ``tyndall compare``."""
    truth = document["reference"]
    width, height = document["size"]
    head = f"**{document['scene']}** ({document['triangles']:,} triangles), {width}×{height}, {document['adapter']}."
    if truth:
        head += (
            f" Reference: {truth['technique']}, {truth['steps']} steps; "
            f"twice as many change `L_v` by {_percent(truth['change_on_doubling'])}."
        )
    rows = []
    for row in document["results"]:
        error = row["error"] or {"rel_rmse": None, "bias": None, "psnr": None}
        psnr = error["psnr"]
        rows.append(
            [
                row["technique"] + (" (paper)" if row["model"] == "paper" else ""),
                *(_ms(row["gpu_ms"][key]) for key in ("median", "min", "p95")),
                _mib(row["memory_bytes"]),
                _percent(error["rel_rmse"]),
                _percent(error["bias"], "+"),
                f"{psnr:.1f}" if psnr is not None else "–",
            ]
        )
    heading = ["technique", "GPU ms", "min", "p95", "MiB", "rel. RMSE", "bias", "PSNR dB"]
    return f"{head}\n\n{_table(heading, rows)}\n"


def splice(page: str, name: str, text: str) -> str:
    """``page`` with what is between ``<!-- name -->`` and ``<!-- /name -->`` replaced by ``text``.

    Raises:
        ValueError: the page has no such place.
    """
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    before, found, rest = page.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"the page has no place '{name}'")
    return f"{before}{begin}\n\n{text.strip()}\n\n{end}{after}"


def _goals(document: Mapping[str, Any]) -> str:
    """The project's own goals at S1's settings, each against the worst of what was measured."""
    scenes = document["scenes"]

    def worst(technique: str | None, figure: Callable[[Mapping[str, Any]], float]) -> float:
        return max(figure(row) for row in scenes if technique in (None, row["technique"]))

    def time(row: Mapping[str, Any]) -> float:
        return float(row["gpu_ms"]["median"])

    def size(row: Mapping[str, Any]) -> float:
        return float(row["memory_bytes"])

    goals = [
        ("froxel, GPU time", worst("froxel", time), 0.15, "ms"),
        ("screen space, GPU time", worst("screen_space", time), 0.25, "ms"),
        ("polygonal, GPU time", worst("polygonal", time), 6.0, "ms"),
        ("froxel, memory", worst("froxel", size) / 2**20, 36.0, "MiB"),
        (
            "polygonal, memory with its shadow map",
            worst("polygonal", lambda row: float(row["memory_bytes"] + row["shadow_bytes"])) / 2**20,
            8.0,
            "MiB",
        ),
        ("screen space, memory but for its parameters", worst("screen_space", size) // 1024, 0.0, "KiB"),
        ("host time of a frame", worst(None, lambda row: float(row["host_ms"]["median"])), 3.0, "ms"),
    ]
    rows = [
        [what, f"{found:.3f} {unit}", f"{goal:g} {unit}", "yes" if found <= goal else "**no**"]
        for what, found, goal, unit in goals
    ]
    text = "The slowest scene, or the largest memory, of those below."
    return f"### Goals\n\n{text}\n\n{_table(['what', 'measured', 'at most', 'met'], rows)}"


def _head(document: Mapping[str, Any]) -> str:
    s, v = document["settings"], document["versions"]
    width, height = s["size"]
    return "\n".join(
        [
            f"**{document['adapter']}**, {document['driver']}, {document['date']}; "
            f"Tyndall {v['tyndall']}, wgpu {v.get('wgpu', '?')}, Python {v['python']}.",
            "",
            f"{width}×{height} pixels, shadow maps {s['shadow_size']}², {_times(s['grid'])} froxels, "
            f"{s['samples']} screen-space samples; medians of up to {s['frames']} frames after {s['warmup']}.",
        ]
    )


def _scenes(document: Mapping[str, Any]) -> str:
    rows = []
    for row in document["scenes"]:
        s1 = s1_milliseconds(row["scene"], row["technique"])
        fps = S1_FPS.get(row["scene"], {}).get(row["technique"])
        gpu = row["gpu_ms"]
        rows.append(
            [
                f"{row['scene']} ({row['triangles']:,})",
                row["technique"],
                *(_ms(gpu[key]) for key in ("median", "min", "p95")),
                _ms(row["frame_ms"]["median"]),
                f"{1000 / row['frame_ms']['median']:.0f}" if row["frame_ms"]["median"] else "–",
                _ms(row["host_ms"]["median"]),
                f"{s1:.2f}" if s1 is not None else "–",
                str(fps) if fps is not None else "–",
            ]
        )
    heading = ["scene (triangles)", "technique", "GPU ms", "min", "p95", "frame ms", "frames/s", "host ms"]
    heading += [f"S1: ms, {S1_MACHINE}", "S1: frames/s"]
    text = (
        "GPU ms is the technique's passes alone; frame ms is the GPU time of the whole frame; host ms is the time to "
        "encode and submit it. S1's columns come from another machine and another base image."
    )
    return f"### Time, one directional light\n\n{text}\n\n{_table(heading, rows)}\n\n{_independence(document)}"


def _independence(document: Mapping[str, Any]) -> str:
    """How far a technique's time depends on the scene."""
    times: dict[str, dict[str, float]] = {}
    for row in document["scenes"]:
        times.setdefault(row["technique"], {})[row["scene"]] = row["gpu_ms"]["median"]
    notes = [
        f"{name} {max(found.values()) / min(found.values()):.2f}"
        for name, found in times.items()
        if len(found) > 1 and min(found.values()) > 0
    ]
    return f"Slowest scene over fastest: {', '.join(notes)}." if notes else "One scene was measured."


def _memory(document: Mapping[str, Any]) -> str:
    first = document["scenes"][0]["scene"]
    rows = [
        [row["technique"], _mib(row["memory_bytes"]), _mib(row["shadow_bytes"])]
        for row in document["scenes"]
        if row["scene"] == first
    ]
    text = "S1's engine held 66.8 MiB for its froxels and 36 MiB a light for its polygonal mesh and shadow map."
    table = _table(["technique", "technique's own MiB", "shadow map MiB"], rows)
    return f"### Memory, one directional light\n\n{text}\n\n{table}"


def _lights(document: Mapping[str, Any]) -> str:
    found = document["lights"]
    counts = [row["lights"] for row in next(iter(found.values()))["rows"]]
    time_rows, memory_rows = [], []
    for name, technique in found.items():
        rows, time, memory = technique["rows"], technique["time_fit"], technique["memory_fit"]
        time_rows.append([name, *(_ms(r["gpu_ms"]["median"]) for r in rows), _ms(time["slope"]), f"{time['r2']:.4f}"])
        totals = (_mib(r["memory_bytes"] + r["shadow_bytes"]) for r in rows)
        memory_rows.append([name, *totals, _mib(memory["slope"]), f"{memory['r2']:.4f}"])
    heads = [str(count) for count in counts]
    return "\n\n".join(
        [
            "### Lights, in box",
            "GPU ms of the technique, with the slope and R² of a straight line through them.",
            _table(["technique", *heads, "ms a light", "R²"], time_rows),
            "MiB of the technique with the shadow maps it reads.",
            _table(["technique", *heads, "MiB a light", "R²"], memory_rows),
        ]
    )


def _resolution(scene: str, found: Mapping[str, Any]) -> str:
    reference = found["reference"]
    state = "" if reference["converged"] else " (not converged)"
    rows = []
    for name, sweep in found["sweeps"].items():
        for row in sweep:
            finest = row.get("against_finest")
            rows.append(
                [
                    name,
                    _times(row["resolution"]),
                    _ms(row["gpu_ms"]["median"]),
                    _mib(row["memory_bytes"]),
                    _percent(row["error"]["rel_rmse"]),
                    _percent(row["error"]["bias"], "+"),
                    _percent(finest["rel_rmse"]) if finest else "–",
                ]
            )
    text = (
        f"Against a march of {reference['steps']} steps{state}, whose last doubling changed `L_v` by "
        f"{_percent(reference['change_on_doubling'])}. The polygonal mesh has the resolution of its shadow map: its "
        "error is against a march on the same map, and in the last column against a march on the finest map."
    )
    heading = ["technique", "resolution", "GPU ms", "MiB", "rel. RMSE", "bias", "finest map"]
    return f"### Error against resolution, in {scene}\n\n{text}\n\n{_table(heading, rows)}"


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; all columns but the first two are numbers."""
    rule = ["---" if i == 0 else "---:" for i in range(len(heading))]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (heading, rule, *rows))


def _ms(ms: float) -> str:
    return f"{ms:.3f}" if abs(ms) < 10 else f"{ms:.1f}"


def _mib(size: float) -> str:
    return f"{size / 2**20:.2f}"


def _percent(fraction: float | None, sign: str = "") -> str:
    return "–" if fraction is None else f"{100 * fraction:{sign}.2f} %"


def _times(value: Any) -> str:
    return "×".join(str(v) for v in value) if isinstance(value, (list, tuple)) else str(value)
