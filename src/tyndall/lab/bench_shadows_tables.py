"""The figures of ``tyndall bench shadows`` as Markdown tables, with S4's own numbers beside them.

S4 (:mod:`tyndall.lab.s4`) published frames per second of 2013, and sentences on each technique's complexity, usability,
speed and quality. The tables hold the measured figure beside each of them. Every table is made from a result alone;
what a result does not hold is not shown, or is a dash.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from tyndall.lab import s4

Document = Mapping[str, Any]
Row = Mapping[str, Any]

GOALS = {"times": 2.0, "light_ms": 0.1, "silhouettes_ms": 0.3, "equal": 0.999}
"""The project's goals: frame rates as multiples of S4's, a shadow-map light, a million triangles' silhouettes, and the
share of pixels away from edges where z-fail equals the hard truth."""

_LARGEST = "the largest light"


def markdown(document: Document) -> str:
    """All tables of a benchmark's document, or of as many parts as it has."""
    parts = [_head(document)]
    cells = document.get("cells", [])
    if cells:
        if document["adapter_type"] != "CPU":
            parts.append(_goals(document))
        parts.append(_study(document))
        parts.append(_every_cell(document))
    if document.get("peer"):
        parts.append(_peer(document))
    if cells or document.get("errors") or document.get("situations"):
        parts.append(_chapter(document))
    if document.get("errors"):
        parts.append(_errors(document))
    if document.get("shrink"):
        parts.append(_shrink(document))
    if document.get("resolution"):
        parts.append(_resolution(document))
    if document.get("situations"):
        parts.append(_situations(document))
    for name, title in (("refused", "Refused"), ("failed", "Not measured")):
        if document.get(name):
            parts.append(_missing(title, document[name]))
    return "\n\n".join(parts) + "\n"


# --- the parts ----------------------------------------------------------------------------------------------------


def _head(document: Document) -> str:
    s, v = document["settings"], document["versions"]
    frame = ", ".join(f"{family} {name}" for family, name in s["frame"].items())
    return "\n".join(
        [
            f"**{document['adapter']}**, {document['driver']}, {document['date']}; "
            f"Tyndall {v['tyndall']}, wgpu {v.get('wgpu', '?')}, Python {v['python']}.",
            "",
            f"{_times(s['size'])} pixels; {frame}; medians of up to {s['frames']} frames after {s['warmup']}.",
        ]
    )


def _goals(document: Document) -> str:
    """The project's own goals, each against what was measured."""
    rows = []

    def goal(what: str, found: str, wanted: str, met: bool) -> None:
        rows.append([what, found, wanted, "yes" if met else "**no**"])

    for label in _of_s4(document):
        ratios = [(ratio, row) for row in document["cells"] if (ratio := _ratio(row)) and row["technique"] == label]
        if ratios:
            worst, row = min(ratios, key=lambda pair: pair[0])
            where = f"{row['triangles']:,} triangles, {_lights(row['lights'])}"
            missed = sum(ratio < GOALS["times"] for ratio, _ in ratios)
            goal(
                f"`{row['technique']}`, frames/s over S4's, least of {len(ratios)} cells",
                f"{worst:.2f}× ({where}); {missed} missed",
                f"≥ {GOALS['times']:g}×",
                not missed,
            )
    for label in ("shadow_map", "shadow_map/compute"):
        cost = document.get("light_cost", {}).get(label)
        one = _cell(document, label, most=True, lights=1)
        if one:
            ms, limit = one["shadow_ms"]["median"], GOALS["light_ms"]
            what = f"map of one light, `{label}`, {one['triangles']:,} triangles, GPU"
            goal(what, f"{ms:.3f} ms", f"≤ {limit:g} ms", ms <= limit)
        if cost:
            ms, limit = cost["frame"]["slope"], GOALS["light_ms"]
            goal(
                f"each light of `{label}` in the whole frame, {cost['triangles']:,} triangles, GPU",
                f"{ms:.3f} ms (R² {cost['frame']['r2']:.2f})",
                f"≤ {limit:g} ms",
                ms <= limit,
            )
    for row in document.get("silhouettes", ()):
        ms, limit = row["silhouettes_ms"], GOALS["silhouettes_ms"]
        what = f"silhouettes of {row['triangles']:,} triangles, `{row['technique']}`, GPU"
        goal(what, f"{ms:.3f} ms", f"≤ {limit:g} ms", ms <= limit)
    for row in document.get("errors", ()):
        if row["technique"] in ("shadow_volume", "shadow_volume/zfail") and row["radius"] == 0:
            share = row["equal_off_edges"]
            goal(
                f"z-fail equals hard truth but at edges, `{row['scene']}`",
                _percent(share),
                f"≥ {_percent(GOALS['equal'])}",
                share is not None and share >= GOALS["equal"],
            )
    compared = _against_peer(document)
    if compared:
        slower = [row for row in compared if row["ours"] >= row["theirs"]]
        worst_peer = min(row["theirs"] / row["ours"] for row in compared)
        label = compared[0]["technique"]
        goal(
            f"`{label}`, whole frame by the clock, over pygfx's, least of {len(compared)} cells",
            f"{worst_peer:.2f} times as fast; {len(slower)} missed",
            "faster",
            not slower,
        )
    return f"### Goals\n\n{_table(['what', 'measured', 'goal', 'met'], rows)}"


def _study(document: Document) -> str:
    """S4's three tables made anew, beside its own numbers."""
    text = (
        "Frames per second: 1000 over the GPU time of the whole frame, in brackets S4's and how many times as many "
        "ours are. S4's program of 2013 drew with Direct3D 11 on an unnamed machine, and its host's time is "
        f"in its numbers. Bold: less than {GOALS['times']:g} times S4's."
    )
    parts = ["### S4's tables", text]
    for label in _of_s4(document):
        found = [row for row in document["cells"] if row["technique"] == label and _ratio(row)]
        if found:
            own = s4.NAMES[_name(found[0])].capitalize()
            parts.append(f"**{own}**, here `{label}`.\n\n{_grid(found, _beside)}")
    if len(parts) == 2:
        parts.append("None of S4's cells was measured.")
    return "\n\n".join(parts)


def _beside(row: Row) -> str:
    ratio, theirs = _ratio(row), s4.fps(row["technique"], row["triangles"], row["lights"])
    if not ratio:
        return _fps(row)
    text = f"{_fps(row)} ({theirs}; {ratio:.1f}×)"
    return text if ratio >= GOALS["times"] else f"**{text}**"


def _every_cell(document: Document) -> str:
    """All techniques in S4's cells; memory and errors beside the times."""
    counts = sorted({row["lights"] for row in document["cells"]})
    last = counts[-1]
    heading = ["technique", "triangles", *(_lights(count) for count in counts)]
    heading += [f"shadows, ms ({last})", f"host ms ({last})", f"by the clock, ms ({last})", f"MiB ({last})"]
    heading += ["error, hard", "error, soft"]
    rows = []
    for label in _labels(document):
        own = [row for row in document["cells"] if row["technique"] == label]
        for triangles in sorted({row["triangles"] for row in own}):
            cells = {row["lights"]: row for row in own if row["triangles"] == triangles}
            end = cells.get(last)
            rows.append(
                [
                    f"`{label}`",
                    f"{triangles:,}",
                    *(_fps(cells[count]) if count in cells else "–" for count in counts),
                    _ms(end["shadow_ms"]["median"]) if end else "–",
                    _ms(end["host_ms"]["median"]) if end else "–",
                    _ms(end["wall_ms"]["median"]) if end else "–",
                    _mib(end["memory_bytes"]) if end else "–",
                    *(_percent(_error(document, label, soft)) for soft in (False, True)),
                ]
            )
    text = (
        "Frames per second by GPU time, by the number of lights. The other columns are of the most lights: GPU time of "
        "the technique's own passes, host time to encode and submit the frame, the clock from the first call until the "
        "device is done, and memory of the technique, with what the scene holds for it: a tree for rays, neighbours of "
        "triangles for outlines. Errors are those of the table *Error against truth* below, of "
        f"`{_first_scene(document)}`."
    )
    return f"### Every technique in S4's cells\n\n{text}\n\n{_table(heading, rows)}"


def _peer(document: Document) -> str:
    """Whole frames of ours and of pygfx by the clock."""
    peer = document["peer"]
    if "failed" in peer:
        return f"### Beside pygfx\n\nNot measured: {peer['failed']}"
    compared = _against_peer(document)
    text = (
        f"pygfx {peer['version']}: the same meshes, lights, camera and size in the same run, `MeshStandardMaterial`, a "
        f"{peer['map_size']}² map a light with its own PCF of 17 taps. Milliseconds of a whole frame by the clock, "
        "from the first call until the device is done, ours with {} / pygfx's; bold where ours is slower."
    )
    if not compared:
        rows = [{**row, "wall": row["wall_ms"]["median"]} for row in peer["cells"]]
        return f"### Beside pygfx\n\n{text.format('–')}\n\n{_grid(rows, lambda row: _ms(row['wall']))}"
    parts = ["### Beside pygfx"]
    for index, label in enumerate(_peer_labels(document)):
        found = _against_peer(document, label)
        table = _grid(found, _beside_peer)
        parts.append(f"{text.format(f'`{label}`')}\n\n{table}" if not index else f"With `{label}`:\n\n{table}")
    return "\n\n".join(parts)


def _beside_peer(row: Row) -> str:
    text = f"{_ms(row['ours'])} / {_ms(row['theirs'])}"
    return text if row["ours"] < row["theirs"] else f"**{text}**"


def _chapter(document: Document) -> str:
    """S4's chapter 4: complexity, usability, speed, quality; and what it says, held against what was measured."""
    cells = document.get("cells", [])
    most = max((row["triangles"] for row in cells), default=0)
    counts = sorted({row["lights"] for row in cells}) or [1]
    first, last = counts[0], counts[-1]
    heading = ["technique", f"passes, {_lights(first)}", f"{_lights(last)}", "host lines", "shader lines"]
    heading += ["lines it stands on", "parameters", "situations served"]
    heading += [f"ms, {most:,} × {first}", f"× {last}", "error, hard", "error, soft"]
    rows = []
    for label in _labels(document):
        what = document["techniques"][label]
        one, all_lights = (_cell(document, label, most=True, lights=count) for count in (first, last))
        asked = [row for row in document.get("situations", ()) if row["technique"] == label and "right" in row]
        served = sum(row["right"] >= SERVED for row in asked)
        refused = len({row["situation"] for row in _refused(document, "situations", label)})
        rows.append(
            [
                f"`{label}`",
                *(str(row["passes"]) if row else "–" for row in (one, all_lights)),
                str(what["lines"]["host"]),
                str(what["lines"]["shader"]),
                str(what["lines"]["below"]),
                str(what["count"]),
                f"{served} of {len(asked) + refused}" if asked or refused else "–",
                *(_ms(row["frame_ms"]["median"]) if row else "–" for row in (one, all_lights)),
                *(_percent(_error(document, label, soft)) for soft in (False, True)),
            ]
        )
    text = (
        "S4 compares its techniques by complexity, usability, speed and quality, in words. Here *complexity* is the "
        "number of passes that a frame has for the shadows, lines of code that are neither blank nor comment (the "
        "technique's own, and of what it stands on), and parameters; *usability*, in how many of the situations below "
        f"{_percent(SERVED)} of all pixels or more are right; *speed*, GPU time of the whole frame; *quality*, "
        "relative RMSE against the truth."
    )
    parts = ["### S4's comparison", text, _table(heading, rows)]
    claims = [claim for made in _CLAIMS if (claim := made(document))]
    if claims:
        parts.append("What S4 says, and what the figures say:")
        parts.append(_table(["technique", "S4 says", "measured", "holds here"], claims))
    return "\n\n".join(parts)


SERVED = 0.99
"""The share of right pixels from which on a technique serves a situation."""


def _errors(document: Document) -> str:
    """Errors against truth, least first, by scene and light."""
    parts = [
        "### Error against truth",
        f"Stills of {_times(document['settings']['error_size'])} against the traced truth, lit by one light that "
        "shines in all directions. *rel. RMSE* is of the surfaces' light, the truth's own noise taken off; *edges* is "
        "the same near edges of shadows; *equal* is the share of pixels that are as lit or as shaded as in the truth, "
        "to 1/255 of the light, and *off edges* the same but near edges. Times are of this size.",
    ]
    keys = dict.fromkeys((row["scene"], row["radius"]) for row in document["errors"])
    for scene, radius in keys:
        own = [row for row in document["errors"] if (row["scene"], row["radius"]) == (scene, radius)]
        own.sort(key=lambda row: (row["rel_rmse"] is None, row["rel_rmse"]))
        heading = ["technique", "rel. RMSE", "edges", "bias", "frame ms", "shadows, ms"]
        rows = [
            [
                f"`{row['technique']}`",
                _percent(row["rel_rmse"]),
                _percent(row["boundary"]),
                _percent(row["bias"], "+"),
                _ms(row["frame_ms"]["median"]),
                _ms(row["shadow_ms"]["median"]),
                *([_percent(row["equal"]), _percent(row["equal_off_edges"])] if radius == 0 else []),
            ]
            for row in own
        ]
        light = "a point" if radius == 0 else f"a ball of {radius:g} m"
        noise = own[0]["noise"]
        sure = f"; the truth's own error is {_percent(noise)}" if noise else ""
        table = _table([*heading, *(["equal", "off edges"] if radius == 0 else [])], rows)
        parts.append(f"**{scene}**, lit by {light}{sure}.\n\n{table}")
    return "\n\n".join(parts)


def _shrink(document: Document) -> str:
    """Errors of what follows the light's size, as that goes to nothing."""
    rows = document["shrink"]
    radii = sorted({row["radius"] for row in rows}, reverse=True)
    # What is asked for more lights than the first two has been seen to follow the largest.
    inner = [radius for radius in radii if 0 < radius < radii[0]]
    labels = [
        label
        for label in dict.fromkeys(row["technique"] for row in rows)
        if not inner or any(row["technique"] == label and row["radius"] in inner for row in rows)
    ]

    def line(label: str, figure: str) -> list[str]:
        own = {row["radius"]: row[figure] for row in rows if row["technique"] == label}
        return [f"`{label}`", *(_percent(own.get(radius)) for radius in radii)]

    heading = [f"{radius:g} m" for radius in radii]
    truths = {row["radius"]: row["truth_to_hard"] for row in rows}
    text = (
        "Techniques whose picture follows the light's size. First the relative RMSE against the truth of the same "
        "light, then against the hard shadow of a point, to which all come as the light shrinks; the truth does too."
    )
    own = _table(["against its own truth", *heading], [line(label, "rel_rmse") for label in labels])
    hard = _table(
        ["against the hard shadow", *heading],
        [*(line(label, "to_hard") for label in labels), ["*truth*", *(_percent(truths[r]) for r in radii)]],
    )
    if not labels:
        return "### As the light shrinks\n\nNo technique that was measured follows the light's size."
    return f"### As the light shrinks\n\n{text}\n\n{own}\n\n{hard}"


def _resolution(document: Document) -> str:
    rows = document["resolution"]
    sizes = sorted({row["texels"] for row in rows})
    body = []
    for label in dict.fromkeys(row["technique"] for row in rows):
        own = {row["texels"]: row for row in rows if row["technique"] == label}
        body.append(
            [
                f"`{label}`",
                *(
                    f"{_percent(own[n]['rel_rmse'])}, {_ms(own[n]['shadow_ms']['median'])} ms" if n in own else "–"
                    for n in sizes
                ),
            ]
        )
    text = (
        "Relative RMSE under a point light, and GPU time of the technique's passes, by the width of its maps in texels."
    )
    return f"### Error against resolution\n\n{text}\n\n{_table(['technique', *(f'{n}²' for n in sizes)], body)}"


def _situations(document: Document) -> str:
    """Which lights, receivers and casters each technique serves."""
    rows = document["situations"]
    found = dict.fromkeys((row["kind"], row["situation"]) for row in [*rows, *_refused(document, "situations")])
    names = [name for kind in ("lights", "receivers", "casters") for k, name in found if k == kind]
    body = []
    for label in _labels(document):
        own = {row["situation"]: row for row in rows if row["technique"] == label}
        refused = {row["situation"] for row in _refused(document, "situations", label)}
        cells = [_served(own[name]) if name in own else "refused" if name in refused else "–" for name in names]
        body.append([f"`{label}`", *cells])
    text = (
        "One small scene a column: the lights `directional`, `spot` and `point` over flat floor and wall; receivers "
        "that are curved, that cast the shadow themselves (`itself`), or are seen from inside a shadow volume "
        "(`inside`); casters that are an open sheet, or a texture with holes (`masked`). The share of pixels that "
        "are nearer to the truth, lit or shaded, than to its opposite; "
        f"bold below {_percent(SERVED)}. For a `rect` light, which has a size, the relative RMSE."
    )
    return f"### What each technique serves\n\n{text}\n\n{_table(['technique', *names], body)}"


def _served(row: Row) -> str:
    if "right" not in row:
        return f"RMSE {_percent(row['rel_rmse'])}"
    return _percent(row["right"]) if row["right"] >= SERVED else f"**{_percent(row['right'])}**"


def _missing(title: str, rows: Sequence[Row]) -> str:
    """Reasons, each once, with how often it was given."""
    counts: dict[tuple[str, str, str], int] = {}
    for row in rows:
        key = (row["part"], row["technique"], row["reason"])
        counts[key] = counts.get(key, 0) + 1
    body = [[f"`{label}`", f"{part} ({count})", reason] for (part, label, reason), count in counts.items()]
    return f"### {title}\n\n{_table(['technique', 'part (figures)', 'reason'], body)}"


# --- what S4 says -------------------------------------------------------------------------------------------------
# Each gives technique, claim, figures and verdict; None where the document lacks the figures.


def _claim_triangles(document: Document) -> list[str] | None:
    few, many = _corner(document, "shadow_map", few=True), _corner(document, "shadow_map")
    if not few or not many or few["triangles"] == many["triangles"]:
        return None
    ratio = many["frame_ms"]["median"] / few["frame_ms"]["median"]
    text = f"{many['triangles']:,} triangles take {ratio:.2f} times as long as {few['triangles']:,}, with one light"
    return ["`shadow_map`", "more objects cost little speed", text, _verdict(ratio < 1.5)]


def _claim_lights(document: Document) -> list[str] | None:
    one, all_lights = _corner(document, "shadow_map"), _corner(document, "shadow_map", lights=True)
    if not one or not all_lights or one["lights"] == all_lights["lights"]:
        return None
    ratio = all_lights["frame_ms"]["median"] / one["frame_ms"]["median"]
    text = f"{_lights(all_lights['lights'])} take {ratio:.2f} times as long as {_lights(one['lights'])}"
    return ["`shadow_map`", "many lights cost much", text, _verdict(ratio > 1.5)]


def _claim_spot(document: Document) -> list[str] | None:
    share = _share(document, "shadow_map", "point")
    if share is None:
        return None
    text = f"under a point light {_percent(share)} of the pixels are right (six maps a light)"
    return ["`shadow_map`", "for spot and directional lights only", text, _verdict(share < SERVED)]


def _claim_texels(document: Document) -> list[str] | None:
    found = [row for row in document.get("resolution", ()) if row["technique"] == "shadow_map"]
    if len(found) < 2:
        return None
    low, high = found[0], found[-1]
    text = ", ".join(
        f"{row['texels']}²: error {_percent(row['rel_rmse'])}, {_ms(row['shadow_ms']['median'])} ms"
        for row in (low, high)
    )
    return [
        "`shadow_map`",
        "quality limited by the map's resolution",
        text,
        _verdict(high["rel_rmse"] < low["rel_rmse"]),
    ]


def _claim_planes(document: Document) -> list[str] | None:
    plane, curved = (_share(document, "projective", name) for name in ("directional", "curved"))
    if plane is None:
        return None
    if curved is None:
        if not _refused(document, "situations", "projective"):
            return None
        text = f"{_percent(plane)} right on planes; it refuses a curved receiver"
        return ["`projective`", "only for shadows on planes", text, "yes"]
    text = f"{_percent(plane)} of pixels right on planes, {_percent(curved)} with a curved receiver"
    return ["`projective`", "only for shadows on planes", text, _verdict(curved < plane)]


def _claim_simple(document: Document) -> list[str] | None:
    lines = {
        name: found
        for name in ("projective", "shadow_map", "shadow_volume")
        if (found := _lines(document, name)) is not None
    }
    if len(lines) < 3:
        return None
    text = ", ".join(f"`{name}` {count}" for name, count in lines.items()) + " lines, with what they stand on"
    holds = lines["projective"] <= lines["shadow_map"] <= lines["shadow_volume"]
    return ["all three", "perspective easiest, maps easy, volumes hard", text, _verdict(holds)]


def _claim_slowest(document: Document) -> list[str] | None:
    times = {}
    for row in document.get("cells", ()):
        if _name(row) in s4.FPS and row["technique"] not in ("shadow_volume/zfail", "shadow_map/compute"):
            corner = _corner(document, row["technique"], lights=True)
            if corner:
                times[_name(row)] = corner["frame_ms"]["median"]
    if "shadow_volume" not in times or len(times) < 2:
        return None
    text = ", ".join(f"`{name}` {_ms(ms)} ms" for name, ms in times.items()) + " with most triangles and lights"
    slowest = max(times, key=lambda name: times[name]) == "shadow_volume"
    return ["`shadow_volume`", "the slowest", text, _verdict(slowest)]


def _claim_exact(document: Document) -> list[str] | None:
    found = {row["technique"]: row for row in document.get("errors", ()) if row["radius"] == 0}
    volume = found.get("shadow_volume/zfail") or found.get("shadow_volume")
    other = found.get("shadow_map")
    if not volume or not other:
        return None
    text = f"hard error {_percent(volume['rel_rmse'])}, that of maps {_percent(other['rel_rmse'])}"
    holds = volume["rel_rmse"] < other["rel_rmse"]
    return ["`shadow_volume`", "excellent quality at any resolution", text, _verdict(holds)]


def _claim_anywhere(document: Document) -> list[str] | None:
    parts = []
    for label in _labels(document):
        if label.partition("/")[0] == "shadow_volume":
            asked = [row for row in document.get("situations", ()) if row["technique"] == label and "right" in row]
            if asked:
                worst = min(asked, key=lambda row: row["right"])
                parts.append(
                    (worst["right"], f"`{label}` at worst {_percent(worst['right'])} right ({worst['situation']})")
                )
    if not parts:
        return None
    text = "; ".join(words for _, words in parts)
    return ["`shadow_volume`", "usable in any application", text, _verdict(max(parts)[0] >= SERVED)]


_CLAIMS: Sequence[Callable[[Document], list[str] | None]] = (
    _claim_simple,
    _claim_triangles,
    _claim_lights,
    _claim_spot,
    _claim_texels,
    _claim_planes,
    _claim_slowest,
    _claim_anywhere,
    _claim_exact,
)


# --- figures of a document ----------------------------------------------------------------------------------------


def _labels(document: Document) -> list[str]:
    return list(document["techniques"])


def _of_s4(document: Document) -> list[str]:
    """The labels of what S4 measured too, in its order."""
    measured = dict.fromkeys(row["technique"] for row in document["cells"])
    return [label for name in s4.FPS for label in measured if label.partition("/")[0] == name]


def _name(row: Row) -> str:
    return str(row["technique"]).partition("/")[0]


def _ratio(row: Row) -> float | None:
    """Ours over S4's frames per second."""
    theirs = s4.fps(row["technique"], row["triangles"], row["lights"])
    return 1000 / row["frame_ms"]["median"] / theirs if theirs and row["frame_ms"]["median"] else None


def _cell(document: Document, label: str, *, most: bool, lights: int) -> Row | None:
    """The cell of so many lights with most, or fewest, triangles."""
    own = [row for row in document.get("cells", ()) if row["technique"] == label and row["lights"] == lights]
    pick = max if most else min
    return pick(own, key=lambda row: row["triangles"]) if own else None


def _corner(document: Document, label: str, *, few: bool = False, lights: bool = False) -> Row | None:
    """A corner of the table: most triangles unless ``few``; least lights unless ``lights``."""
    counts = [row["lights"] for row in document.get("cells", ()) if row["technique"] == label]
    if not counts:
        return None
    return _cell(document, label, most=not few, lights=max(counts) if lights else min(counts))


def _first_scene(document: Document) -> str:
    return next((row["scene"] for row in document.get("errors", ())), "–")


def _error(document: Document, label: str, soft: bool) -> float | None:
    scene = _first_scene(document)
    for row in document.get("errors", ()):
        if row["scene"] == scene and row["technique"] == label and (row["radius"] > 0) == soft:
            return float(row["rel_rmse"]) if row["rel_rmse"] is not None else None
    return None


def _share(document: Document, label: str, situation: str) -> float | None:
    for row in document.get("situations", ()):
        if row["technique"] == label and row["situation"] == situation and "right" in row:
            return float(row["right"])
    return None


def _lines(document: Document, name: str) -> int | None:
    for label, what in document["techniques"].items():
        if label.partition("/")[0] == name:
            return int(sum(what["lines"].values()))
    return None


def _refused(document: Document, part: str, label: str | None = None) -> list[Row]:
    found = document.get("refused", ())
    return [row for row in found if row["part"] == part and label in (None, row["technique"])]


def _peer_labels(document: Document) -> list[str]:
    """What stands beside pygfx: a map with PCF as it has, where there is one, and the plain maps."""
    measured = {row["technique"] for row in document.get("cells", ())}
    return [label for label in ("pcf", "shadow_map", "shadow_map/compute") if label in measured]


def _against_peer(document: Document, label: str | None = None) -> list[dict[str, Any]]:
    """Whole frames by the clock where both were measured."""
    labels = _peer_labels(document)
    theirs = {(r["triangles"], r["lights"]): r["wall_ms"]["median"] for r in document.get("peer", {}).get("cells", ())}
    label = label or (labels[0] if labels else "")
    return [
        {
            "technique": label,
            "triangles": row["triangles"],
            "lights": row["lights"],
            "ours": row["wall_ms"]["median"],
            "theirs": theirs[key],
        }
        for row in document.get("cells", ())
        if row["technique"] == label and (key := (row["triangles"], row["lights"])) in theirs
    ]


# --- text ---------------------------------------------------------------------------------------------------------


def _grid(rows: Sequence[Row], text: Callable[[Row], str]) -> str:
    """A table of triangles by lights."""
    cells = {(row["triangles"], row["lights"]): row for row in rows}
    counts = sorted({lights for _, lights in cells})
    body = [
        [f"{n:,}", *(text(cells[n, count]) if (n, count) in cells else "–" for count in counts)]
        for n in sorted({triangles for triangles, _ in cells})
    ]
    return _table(["triangles", *(_lights(count) for count in counts)], body)


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; all columns but the first are numbers."""
    rule = ["---" if i == 0 else "---:" for i in range(len(heading))]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (heading, rule, *rows))


def _fps(row: Row) -> str:
    ms = row["frame_ms"]["median"]
    return f"{1000 / ms:,.0f}" if ms else "–"


def _lights(count: int) -> str:
    return "1 light" if count == 1 else f"{count} lights"


def _ms(ms: float) -> str:
    return f"{ms:.3f}" if abs(ms) < 10 else f"{ms:.1f}"


def _mib(size: float) -> str:
    return f"{size / 2**20:.2f}"


def _percent(fraction: float | None, sign: str = "") -> str:
    return "–" if fraction is None else f"{100 * fraction:{sign}.2f} %"


def _times(value: Sequence[int]) -> str:
    return "×".join(str(v) for v in value)


def _verdict(holds: bool) -> str:
    return "yes" if holds else "no"
