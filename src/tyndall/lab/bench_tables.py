"""The benchmark's figures as Markdown tables and as plots, with S1's own numbers beside them.

S1 (:mod:`tyndall.lab.s1`) published frames per second with and without each technique on an RTX 4060 Laptop; the time
of a technique is then ``1000/fps − 1000/fps_off``. That is another machine and another base image: its columns show
the order of magnitude and the trend, not a race. Every table and plot is made from a result alone; what a result does
not hold is not shown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from tyndall.lab import s1
from tyndall.lab.plots import Dots, Lines

_OTHER = f"another machine, {s1.MACHINE}"
_PLOTS = {
    "time": "Figure 20: time of each technique in each scene, S1's beside ours",
    "lights": "Figure 21: time of each technique against the number of lights",
    "memory": "Figure 22: memory of each technique against the number of lights",
}


def markdown(document: Mapping[str, Any], images: str | None = None) -> str:
    """All tables of a benchmark's document, or of as many parts as it has.

    Args:
        images: how the names of the plots' files begin, folder included (``images/h200-``); None shows no plots.
    """
    parts = [_head(document)]
    if document.get("scenes"):
        if document["adapter_type"] != "CPU" and document["settings"]["size"] == list(s1.TECHNICAL["picture"]):
            parts.append(_goals(document))
        parts += [_study(document, images), _scenes(document), _memory(document)]
    if document.get("lights"):
        parts.append(_lights(document))
    parts += [_resolution(name, found) for name, found in document.get("resolution", {}).items() if found["reference"]]
    if judged := {name: found for name, found in document.get("truth", {}).items() if found["rows"]}:
        parts.append(_truth(judged, document["settings"]["shadow_size"]))
    if document.get("failed"):
        rows = [[row["point"], row["reason"]] for row in document["failed"]]
        parts.append(f"### Not measured\n\n{_table(['point', 'reason'], rows)}")
    return "\n\n".join(parts) + "\n"


def plots(document: Mapping[str, Any]) -> dict[str, str]:
    """S1's figures 20 to 22 from a benchmark's document, as SVG files by name; of as many as it has the parts."""
    found = {}
    machine = str(document["adapter"])
    if document.get("scenes"):
        groups: dict[str, list[tuple[str, tuple[float, float | None]]]] = {}
        for row in document["scenes"]:
            if row["technique"] != "off":
                ms = (row["gpu_ms"]["median"], s1.milliseconds(row["scene"], row["technique"]))
                groups.setdefault(row["scene"], []).append((row["technique"], ms))
        found["time"] = Dots(
            title="Time of each technique, one light",
            description=f"GPU milliseconds on {machine}, beside those that follow from S1's frame rates: {_OTHER}.",
            unit="ms",
            kinds=(machine, f"S1: {_OTHER}"),
            groups=list(groups.items()),
        ).svg()
    if document.get("lights"):
        measured = document["lights"]
        counts = [row["lights"] for row in next(iter(measured.values()))["rows"]]
        complete = {n: t["rows"] for n, t in measured.items() if [row["lights"] for row in t["rows"]] == counts}
        found["lights"] = Lines(
            title=f"Time against the number of lights, {machine}",
            description="GPU milliseconds of each technique in box; both axes are logarithmic.",
            across="lights",
            unit="ms",
            places=counts,
            series={n: [row["gpu_ms"]["median"] for row in rows] for n, rows in complete.items() if n != "off"},
        ).svg()
        found["memory"] = Lines(
            title=f"Memory against the number of lights, {machine}",
            description="MiB of each technique with the shadow maps that it reads, in box.",
            across="lights",
            unit="MiB",
            places=counts,
            series={n: [_both(row) / 2**20 for row in rows] for n, rows in complete.items() if n != "off"},
        ).svg()
    return found


def comparison(document: Mapping[str, Any]) -> str:
    """The table of a ``results.json`` of ``tyndall compare``."""
    truth = document["reference"]
    width, height = document["size"]
    head = f"**{document['scene']}** ({document['triangles']:,} triangles), {width}×{height}, {document['adapter']}."
    if truth and "steps" in truth:
        head += (
            f" Reference: {truth['technique']}, {truth['steps']} steps; "
            f"twice as many change `L_v` by {_percent(truth['change_on_doubling'])}."
        )
    elif truth:
        kind, noise = next(iter(truth["relative_error"].items()))
        head += (
            f" Truth: {truth['judge']}, {truth['samples']} samples a pixel; its own standard error, {_percent(noise)} "
            f"of the {kind} light, is taken off the errors. *Edges* is the error near edges of shadows; *scaled* is "
            "what the best-fitting factor leaves where light is right up to one only."
        )
    heading = ["technique", "GPU ms", "min", "p95", "MiB", "rel. RMSE", "bias", "PSNR dB"]
    if any("errors" in row for row in document["results"]):
        heading += ["edges", "scaled"]
    return f"{head}\n\n{_table(heading, [_compared(row) for row in document['results']])}\n"


def _compared(row: Mapping[str, Any]) -> list[str]:
    """A row of :func:`comparison`; longer where all errors are known."""
    error = row["error"] or {"rel_rmse": None, "bias": None, "psnr": None}
    known: Mapping[str, Any] = next(iter(row.get("errors", {}).values()), {})
    limit = known.get("rel_rmse_limit") if known.get("within_noise") else None
    cells = [
        row["technique"] + (" (paper)" if row["model"] == "paper" else ""),
        *(_ms(row["gpu_ms"][key]) for key in ("median", "min", "p95")),
        _mib(row["memory_bytes"]),
        f"< {_percent(limit)}" if limit is not None else _percent(known.get("rel_rmse_corrected", error["rel_rmse"])),
        _percent(error["bias"], "+"),
        f"{error['psnr']:.1f}" if error["psnr"] is not None else "–",
    ]
    if "errors" in row:
        scaled = known.get("scaled_rel_rmse") if row["up_to_scale"] else None
        cells += [_percent(known.get("boundary")), _percent(scaled)]
    return cells


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


def _study(document: Mapping[str, Any], images: str | None) -> str:
    """S1's tables 1 to 6 and figures 20 to 22, made anew, with its own numbers."""
    text = (
        f"Columns that begin with *S1* hold what S1 printed, measured on {_OTHER}. Its scenes *Bunny Box*, *Classroom* "
        "and *San Miguel* stand beside `box`, `blinds` and `courtyard`, which have their character and their numbers "
        "of triangles. The parameters are those of the techniques' `paper` models, with which its pictures are "
        "repeated; times are those of the `physical` models."
    )
    return "\n\n".join(
        [
            "### S1's tables and figures",
            text,
            _study_scenes(document),
            _study_settings(document),
            _study_parameters(document),
            _study_rates(document),
            *([_study_figures(document, images)] if images is not None else []),
        ]
    )


def _study_scenes(document: Mapping[str, Any]) -> str:
    found = {row["scene"]: row["triangles"] for row in document["scenes"]}
    rows = [[name, f"{count:,}", *_named(s1.SCENES.get(name))] for name, count in found.items()]
    return f"**Table 1**, scenes.\n\n{_table(['scene', 'triangles', 'S1: scene', 'S1: triangles'], rows)}"


def _named(scene: tuple[str, int] | None) -> list[str]:
    return [scene[0], f"{scene[1]:,}"] if scene else ["–", "–"]


def _study_settings(document: Mapping[str, Any]) -> str:
    s = document["settings"]
    map_size = s["shadow_size"]
    ours = [s["size"], [map_size, map_size], s["grid"], [s["samples"]]]
    rows = [
        [name, _times(own), _times(list(theirs))]
        for own, (name, theirs) in zip(ours, s1.TECHNICAL.items(), strict=True)
    ]
    return f"**Table 2**, sizes.\n\n{_table(['what', 'here', 'S1'], rows)}"


def _study_parameters(document: Mapping[str, Any]) -> str:
    names = [name for name in s1.SCENES if any(row["scene"] == name for row in document["scenes"])]
    rows = []
    for technique, parameters in s1.VISUAL.items():
        found = {r["scene"]: r for r in document["scenes"] if r["technique"] == technique}
        for parameter, theirs in parameters.items():
            cells = [technique, "light, L_c" if parameter == "light" else parameter]
            for name in names:
                row = found.get(name, {})
                own = row.get("intensity") if parameter == "light" else row.get("parameters", {}).get(parameter)
                cells += [_plain(own), _plain(theirs[list(s1.SCENES).index(name)])]
            rows.append(cells)
    heading = ["technique", "parameter", *(cell for name in names for cell in (name, f"S1: {s1.SCENES[name][0]}"))]
    return f"**Tables 3, 4 and 5**, what each technique's look is set to.\n\n{_table(heading, rows)}"


def _study_rates(document: Mapping[str, Any]) -> str:
    columns = ("off", "froxel", "screen_space", "polygonal")
    rows = []
    for name in dict.fromkeys(row["scene"] for row in document["scenes"]):
        own = {row["technique"]: row for row in document["scenes"] if row["scene"] == name}
        ours = [_rate(own[c]["frame_ms"]["median"]) if c in own else "–" for c in columns]
        rows.append([name, *ours, *(str(s1.FPS.get(name, {}).get(c, "–")) for c in columns)])
    text = (
        "**Table 6**, frames per second with one light: 1000 over the GPU time of a frame here; as shown there, by "
        f"{_OTHER}, whose base image traces its shadows."
    )
    return f"{text}\n\n{_table(['scene', *columns, *(f'S1: {c}' for c in columns)], rows)}"


def _study_figures(document: Mapping[str, Any], images: str) -> str:
    made = plots(document)
    links = [f"![{text}]({images}{name}.svg)" for name, text in _PLOTS.items() if name in made]
    text = (
        "**Figures 20, 21 and 22**, made anew. S1 prints no numbers in its plots: those of its figure 20 are what its "
        "table 6 gives; of figures 21 and 22 it says that time and memory grow linearly with the lights for every "
        f"method (the slopes and R² are below). {_held()}"
    )
    return "\n\n".join([text, *links])


def _truth(judged: Mapping[str, Mapping[str, Any]], shadow_size: int) -> str:
    """Errors against a traced truth: one table over the scenes, and one a scene with every metric."""
    first = next(iter(judged.values()))
    width, height = first["size"]
    text = (
        f"Stills of {width}×{height} against the path-traced truth, in which rays and not a shadow map say what the "
        "light reaches. *rel. RMSE* and *bias* are of `L_v` as everywhere on this page, with the truth's own noise "
        "taken off. *At best scale* is the error that is left after the one factor that fits best, *scale*: it tells "
        "the shape of the light apart from its strength, of use for screen space, which is right up to a factor at "
        f"most. FLIP and SSIM are of the whole linear picture. Shadow maps have {shadow_size}² texels where no other "
        "size is given; rows of a march that has converged show the error of their shadow map alone."
    )
    labels = [[_truth_label(row, shadow_size) for row in found["rows"]] for found in judged.values()]
    by_scene = [
        {label: row["errors"]["inscattered"] for label, row in zip(names, found["rows"], strict=True)}
        for names, found in zip(labels, judged.values(), strict=True)
    ]
    rows = [
        [label, *(_percent(own.get(label, {}).get("rel_rmse_corrected")) for own in by_scene)]
        for label in dict.fromkeys(label for names in labels for label in names)
    ]
    parts = ["### Error against truth", text, _table(["rel. RMSE of `L_v`", *judged], rows)]
    heading = ["technique", "rel. RMSE", "bias", "at best scale", "scale", "picture: rel. RMSE", "FLIP", "SSIM"]
    for names, (scene, found) in zip(labels, judged.items(), strict=True):
        how = found["truth"]
        rows = []
        for label, row in zip(names, found["rows"], strict=True):
            light, picture = row["errors"]["inscattered"], row["errors"]["radiance"]
            scaled = light["best_scale"] if light["best_scale"] else None
            rows.append(
                [
                    label,
                    _percent(light["rel_rmse_corrected"]),
                    _percent(light["bias"], "+"),
                    _percent(light["scaled_rel_rmse"] if scaled else None),
                    _decimal(scaled),
                    _percent(picture["rel_rmse_corrected"]),
                    _decimal(picture["flip"]),
                    _decimal(picture["ssim"]),
                ]
            )
        noise = _percent(how["relative_error"]["inscattered"])
        parts.append(
            f"**{scene}**: truth of {how['samples']:,} samples a pixel, traced in {how['seconds']:.1f} s; its own "
            f"relative standard error is {noise} of `L_v`, {_percent(how['relative_error']['radiance'])} of the "
            "picture.\n\n" + _table(heading, rows)
        )
    return "\n\n".join(parts)


def _truth_label(row: Mapping[str, Any], shadow_size: int) -> str:
    label = str(row["technique"])
    if label == "march":
        label += f", {row['parameters']['steps']} steps"
    size = row["shadow"].get("size")
    return label if size in (None, shadow_size) else f"{label}, map of {size}²"


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
            worst("polygonal", _both) / 2**20,
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
        theirs = s1.milliseconds(row["scene"], row["technique"])
        fps = s1.FPS.get(row["scene"], {}).get(row["technique"])
        gpu = row["gpu_ms"]
        rows.append(
            [
                f"{row['scene']} ({row['triangles']:,})",
                row["technique"],
                *(_ms(gpu[key]) for key in ("median", "min", "p95")),
                _ms(row["frame_ms"]["median"]),
                _rate(row["frame_ms"]["median"]),
                _ms(row["host_ms"]["median"]),
                f"{theirs:.2f}" if theirs is not None else "–",
                str(fps) if fps is not None else "–",
            ]
        )
    heading = ["scene (triangles)", "technique", "GPU ms", "min", "p95", "frame ms", "frames/s", "host ms"]
    heading += [f"S1: ms, {s1.MACHINE}", "S1: frames/s"]
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
    text = _held()
    table = _table(["technique", "technique's own MiB", "shadow map MiB"], rows)
    return f"### Memory, one directional light\n\n{text}\n\n{table}"


def _lights(document: Mapping[str, Any]) -> str:
    found = document["lights"]
    counts = [row["lights"] for row in next(iter(found.values()))["rows"]]
    time_rows, memory_rows = [], []
    for name, technique in found.items():
        rows, time, memory = technique["rows"], technique["time_fit"], technique["memory_fit"]
        time_rows.append([name, *(_ms(r["gpu_ms"]["median"]) for r in rows), _ms(time["slope"]), f"{time['r2']:.4f}"])
        totals = (_mib(_both(r)) for r in rows)
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


def _held() -> str:
    froxel, polygonal = (f"{s1.MEMORY[name]:g} MiB" for name in ("froxel", "polygonal"))
    return f"S1's engine held {froxel} for its froxels and {polygonal} a light for its polygonal mesh and shadow map."


def _both(row: Mapping[str, Any]) -> float:
    """Bytes of a technique with the shadow maps that it reads."""
    return float(row["memory_bytes"] + row["shadow_bytes"])


def _rate(ms: float) -> str:
    return f"{1000 / ms:.0f}" if ms else "–"


def _plain(value: float | None) -> str:
    return "–" if value is None else f"{value:g}"


def _decimal(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"


def _ms(ms: float) -> str:
    return f"{ms:.3f}" if abs(ms) < 10 else f"{ms:.1f}"


def _mib(size: float) -> str:
    return f"{size / 2**20:.2f}"


def _percent(fraction: float | None, sign: str = "") -> str:
    return "–" if fraction is None else f"{100 * fraction:{sign}.2f} %"


def _times(value: Any) -> str:
    return "×".join(str(v) for v in value) if isinstance(value, (list, tuple)) else str(value)
