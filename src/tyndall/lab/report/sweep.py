"""The page of a sweep: what was measured against what varied, and a table of all points.

It is made from ``results.jsonl`` (:mod:`tyndall.lab.sweep_store`): an object a line, of which the later one counts
where two have the same ``id``; a line that is none is passed over, since a run may still be writing. ``points.json``
has the ids of the folder's present specification, in order; rows of an earlier one are left out.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tyndall.lab.picture import OutputError
from tyndall.lab.report import verdict
from tyndall.lab.report.markup import Html, data, tag
from tyndall.lab.report.table import scroll

FILE = "results.jsonl"
POINTS = "points.json"
MOST_ROWS = 4000  # that a page shows

_MEASURING = frozenset({"truth", "frames", "warmup", "seconds", "seed", "metrics"})
_TIMES = {
    "gpu_ms": "GPU time of the technique",
    "shadow_ms": "GPU time of shadows",
    "frame_ms": "GPU time of the frame",
    "host_ms": "host time",
}

_CAPTION = (
    "A line joins points that differ only in what is drawn across. Across a measure, a line is the Pareto front of a "
    "scene at a size with its lights. The table below has the data."
)

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Dimension:
    """Something that varies between points.

    Attributes:
        values: in words, in their order on an axis.
        numbers: the same as numbers, where all of them are.
        places: of each row, which of them it has; None where it has none, as another technique's parameter.
    """

    name: str
    values: list[str]
    numbers: list[float] | None
    places: list[int | None]


@dataclass(frozen=True)
class Measure:
    """Something that was measured: a value a row, or None; in the rows of ``hidden`` it is at most that."""

    name: str
    unit: str
    log: bool
    values: list[float | None]
    hidden: list[int]


def read_rows(folder: Path) -> tuple[list[Row], int]:
    """The rows of a sweep's folder, each point once, and how many others are left out.

    Raises:
        OutputError: a file cannot be read, holds no row of the sweep, or a row whose figures are no numbers.
    """
    path = folder / FILE
    rows: dict[str, Row] = {}
    for line in _read(path).split("\n"):  # other ends of lines stand in texts
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(row, dict) and isinstance(row.get("point"), dict) and "id" in row:
            rows[str(row["id"])] = row
    kept = rows
    if (folder / POINTS).exists():
        try:
            asked = [str(id) for id in json.loads(_read(folder / POINTS))]
        except (ValueError, TypeError, RecursionError) as error:
            raise OutputError(f"{folder / POINTS}: is not a list of points") from error
        kept = {id: rows[id] for id in asked if id in rows}
    if not kept:
        raise OutputError(f"{path}: holds no rows of {'a' if kept is rows else 'this'} sweep")
    for id, row in kept.items():
        for name, value in _figures(row):
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise OutputError(f"{path}: point {id}: {name}: {value!r} is not a number")
    return list(kept.values()), len(rows) - len(kept)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error


def _figures(row: Row) -> Iterator[tuple[str, Any]]:
    """What the page shows of a row as numbers, where it is there."""
    errors = row.get("errors") or {}
    groups: dict[str, Any] = {key: row.get(key) for key in _TIMES}
    if isinstance(errors, dict):
        groups |= {f"errors.{kind}": scores for kind, scores in errors.items()}
    else:
        groups["errors"] = errors
    keys = ("median", "rel_rmse_limit", *(metric.key for metric in verdict.METRICS))
    for name, group in groups.items():
        if isinstance(group, dict):
            yield from ((f"{name}.{key}", group[key]) for key in keys if group.get(key) is not None)
        elif group is not None:
            yield name, group
    if row.get("memory_bytes") is not None:
        yield "memory_bytes", row["memory_bytes"]


def dimensions(rows: Sequence[Row]) -> list[Dimension]:
    """What differs between the rows: scene, lights, size, techniques, their parameters; "variant" is the technique
    with those of its parameters that vary."""
    points = [_flat(row["point"]) for row in rows]
    names = dict.fromkeys(name for point in points for name in point)
    varied = [n for n in names if len({_word(p[n]) for p in points if n in p}) > 1]
    for point in points:
        technique = str(point.get("technique"))
        own = [_word(point[n]) for n in varied if n.startswith(f"{technique}.") and n in point]
        point["variant"] = " ".join([technique, *own])
    if len({p["variant"] for p in points}) > len({p.get("technique") for p in points}):
        varied.append("variant")
    return [_dimension(name, points) for name in varied or ["technique"]]


def measures(rows: Sequence[Row]) -> list[Measure]:
    """What was measured: times, bytes, errors by kind of light."""
    found = []
    for key, name in _TIMES.items():
        found.append(Measure(name, "ms", True, [_number(row.get(key), "median") for row in rows], []))
    sizes = [_number(row, "memory_bytes") for row in rows]
    found.append(Measure("memory of the technique", "MiB", True, [None if s is None else s / 2**20 for s in sizes], []))
    kinds = dict.fromkeys(kind for row in rows for kind in (row.get("errors") or {}))
    for kind in kinds:
        for metric in verdict.METRICS:
            factor = 100 if metric.unit == "%" else 1
            scores = [(row.get("errors") or {}).get(kind) or {} for row in rows]
            known = [verdict.judged(score, metric.key) for score in scores]
            values = [factor * error.value if error else None for error in known]
            hidden = [i for i, error in enumerate(known) if error and error.hidden]
            log = metric.better == "less" and metric.key != "flip"
            found.append(Measure(f"{metric.name}, {verdict.kind_name(kind)}", metric.unit, log, values, hidden))
    return [measure for measure in found if any(v is not None for v in measure.values)]


def sweep(rows: Sequence[Row], aside: int, name: str) -> Html:
    """The sweep as an article; ``aside`` rows of its file are not of its specification."""
    shown = [row for row in rows if row.get("status") == "done"][:MOST_ROWS]
    failed = [row for row in rows if row.get("status") != "done"]
    varied = dimensions(shown or rows)
    measured = measures(shown)
    over = verdict.listed([f"{d.name} ({len(d.values)})" for d in varied if d.name != "variant"])
    lead = f"{len(rows)} points over {over}." if len(rows) > 1 else "One point."
    notes = []
    if failed:
        notes.append(f"{len(failed)} of them could not be measured; the table says why.")
    if aside:
        notes.append(f"{aside} rows of {FILE} are not of this specification, and are left out.")
    if len(shown) < len(rows) - len(failed):
        notes.append(f"This page shows the first {len(shown)}; {FILE} holds them all.")
    adapters = list(dict.fromkeys(str(row["adapter"]) for row in shown if row.get("adapter")))
    judges = dict.fromkeys(str((row.get("truth") or {}).get("judge", "none")) for row in shown)
    versions = dict.fromkeys(str((row.get("versions") or {}).get("tyndall", "?")) for row in shown)
    facts = {
        "Adapter": ", ".join(adapters),
        "Driver": ", ".join(dict.fromkeys(str(row["driver"]) for row in shown if row.get("driver"))),
        "Truth": ", ".join(judges),
        "Tyndall": ", ".join(versions),
    }
    return tag(
        "article",
        tag(
            "header",
            tag("h1", name),
            tag("p", lead, class_="lead"),
            tag("p", " ".join(notes), class_="remarks"),
            tag("dl", *(tag("div", tag("dt", k), tag("dd", v)) for k, v in facts.items() if v), class_="facts"),
            class_="opening",
        ),
        *(
            _explorer(title, f"s-plot{i}", varied, measured, opening)
            for i, (title, opening) in enumerate(_openings(varied, measured))
        ),
        _table(shown, failed, varied, measured),
        data({"dimensions": [d.__dict__ for d in varied], "measures": [m.__dict__ for m in measured]}, class_="data"),
        class_="sweep",
        aria_label=f"Sweep: {name}",
        id="s",
    )


def _openings(varied: Sequence[Dimension], measured: Sequence[Measure]) -> list[tuple[str, dict[str, str]]]:
    """The plots that a page begins with: time against what varies, and time against error."""
    names = [d.name for d in varied]
    series = "variant" if "variant" in names else "technique" if "technique" in names else names[0]
    facet = next((name for name in ("scene", "lights", "size") if name in names), "")
    numeric = [d.name for d in varied if d.numbers]
    number = next(iter(numeric), next((name for name in names if name not in (series, facet)), series))
    times = [m.name for m in measured if m.unit == "ms"]
    errors = [m.name for m in measured if m.name.startswith((verdict.BY_KEY["rel_rmse_corrected"].name, "relative"))]
    others = {"series": series, "facet": facet if facet != number else ""}
    found = []
    if times:
        found.append(("Time against what varies", {"x": number, "y": times[0], **others}))
    if errors:
        found.append(("Error against what varies", {"x": number, "y": errors[0], **others}))
    if times and errors:
        found.append(("Time against error", {"x": times[0], "y": errors[0], "series": series, "facet": facet}))
    return found


def _explorer(
    title: str,
    prefix: str,
    varied: Sequence[Dimension],
    measured: Sequence[Measure],
    opening: Mapping[str, str],
) -> Html:
    dims, both = [d.name for d in varied], [d.name for d in varied] + [m.name for m in measured]
    choices = (
        ("Across", "x", both),
        ("Up", "y", [m.name for m in measured]),
        ("Colour", "series", dims),
        ("A plot for each", "facet", ["", *dims]),
    )
    pickers = [
        tag(
            "label",
            tag("span", text),
            tag(
                "select",
                *(tag("option", name or "(one plot)", value=name, selected=name == opening[role]) for name in names),
                data_role=role,
            ),
        )
        for text, role, names in choices
    ]
    return tag(
        "section",
        tag("h2", title),
        tag(
            "figure",
            tag("div", *pickers, class_="tools script"),
            tag("div", data_role="filters", class_="tools script"),
            tag("div", data_role="legend", class_="legend script"),
            tag("div", data_role="plots", class_="plot panels script"),
            tag("figcaption", _CAPTION),
        ),
        class_="explorer",
        id=prefix,
    )


def _table(
    shown: Sequence[Row], failed: Sequence[Row], varied: Sequence[Dimension], measured: Sequence[Measure]
) -> Html:
    dims = [d for d in varied if d.name != "variant"]
    names = [d.name for d in dims] + [f"{m.name} {m.unit}".strip() for m in measured]
    heads = [
        tag("th", tag("button", name, type="button", aria_label=f"{name}: sort"), scope="col", aria_sort="none")
        for name in names
    ]
    rows = []
    for i in range(len(shown)):
        cells = [_place(d, i) for d in dims]
        cells += [_cell(m.values[i], i in m.hidden) for m in measured]
        rows.append(tag("tr", *cells))
    made = tag("table", tag("thead", tag("tr", *heads)), tag("tbody", *rows), class_="sortable")
    lost = None
    if failed:
        lines = [
            tag("tr", tag("td", _named(row), class_="text"), tag("td", str(row.get("reason")), class_="text"))
            for row in failed
        ]
        head = tag("tr", tag("th", "point", scope="col"), tag("th", "reason", scope="col", class_="text"))
        lost = tag(
            "div", tag("h3", "Not measured"), scroll(tag("table", tag("thead", head), tag("tbody", *lines)), "Lost")
        )
    return tag("section", tag("h2", "All points"), scroll(made, "All points"), lost, id="s-table")


def _place(dimension: Dimension, row: int) -> Html:
    place = dimension.places[row]
    if place is None:
        return tag("td", "–", class_="text")
    return tag("td", dimension.values[place], class_="text", data_value=place)


def _cell(value: float | None, hidden: bool) -> Html:
    if value is None:
        return tag("td", "–")
    return tag("td", ("<\u00a0" if hidden else "") + verdict.significant(value, 3), data_value=repr(value))


def _named(row: Row) -> str:
    point = _flat(row["point"])
    return ", ".join(_word(point[name]) for name in ("scene", "lights", "size", "technique") if name in point)


def _flat(point: Mapping[str, Any]) -> dict[str, Any]:
    """A point as names and values: each technique by its family, and its parameters as ``technique.parameter``;
    those of rays as ``marching.parameter``."""
    flat: dict[str, Any] = {}
    for name, value in point.items():
        if name in _MEASURING:
            continue
        if isinstance(value, Mapping):
            technique = str(value.get("technique", name))
            if "technique" in value:
                flat[name] = technique
            flat |= {f"{technique}.{key}": v for key, v in value.items() if key != "technique"}
        else:
            flat[name] = Path(value).name if name == "scene" else value
    return flat


def _dimension(name: str, points: Sequence[Mapping[str, Any]]) -> Dimension:
    values: dict[str, Any] = {_word(p[name]): p[name] for p in points if name in p}
    if all(_size_of(v) is not None for v in values.values()):
        values = dict(sorted(values.items(), key=lambda item: _size_of(item[1]) or 0.0))
    words = list(values)
    plain = [float(v) for v in values.values() if isinstance(v, int | float) and not isinstance(v, bool)]
    return Dimension(
        name=name,
        values=words,
        numbers=plain if len(plain) == len(words) else None,
        places=[words.index(_word(p[name])) if name in p else None for p in points],
    )


def _size_of(value: Any) -> float | None:
    """What to sort by: a number, or the product of several, as of a grid."""
    parts = value if isinstance(value, list) else [value]
    size = 1.0
    for part in parts:
        if isinstance(part, bool) or not isinstance(part, int | float):
            return None
        size *= part
    return size


def _word(value: Any) -> str:
    if isinstance(value, list):
        return "×".join(_word(v) for v in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _number(record: Any, key: str) -> float | None:
    value = record.get(key) if isinstance(record, Mapping) else None
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
