"""The table of all figures, and what tables share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby

from tyndall.lab.report import verdict
from tyndall.lab.report.markup import Html, tag
from tyndall.lab.report.results import Study, Times

COLOURS = 8  # that report.css knows


@dataclass(frozen=True)
class _Column:
    """One figure of all techniques: ``values`` in plain units for sorting, ``texts`` as they are read."""

    group: str
    name: str
    values: Sequence[float | None]
    texts: Sequence[str | None]
    best: frozenset[int] = frozenset()


def table(study: Study, prefix: str) -> Html:
    """Every figure of every technique; the button in a column's head sorts by it."""
    columns = [*_times(study), *_memory(study), *_errors(study)]
    groups = [(name, len(list(members))) for name, members in groupby(columns, key=lambda column: column.group)]
    top = tag("tr", tag("td"), *(tag("th", name, colspan=n, scope="colgroup") for name, n in groups))
    heads = [tag("th", tag("button", "technique", type="button"), scope="col", aria_sort="none")]
    heads += [
        tag(
            "th",
            tag("button", column.name, type="button", aria_label=f"{column.group}, {column.name}: sort"),
            scope="col",
            aria_sort="none",
        )
        for column in columns
    ]
    rows = [
        tag(
            "tr",
            tag("th", tag("i", class_=f"swatch k{i % COLOURS}", aria_hidden="true"), result.label, scope="row"),
            *(_cell(column.texts[i], column.values[i], i in column.best) for column in columns),
            data_result=i,
        )
        for i, result in enumerate(study.results)
    ]
    made = tag("table", tag("thead", top, tag("tr", *heads)), tag("tbody", *rows), class_="sortable")
    return tag(
        "section",
        tag("h2", "All figures"),
        tag("p", "Bold is the best of a column. A column’s head sorts by it.", class_="note"),
        scroll(made, "All figures"),
        id=f"{prefix}-table",
    )


def scroll(made: Html, name: str) -> Html:
    """A table that scrolls by itself where the screen is narrow, also by the keyboard."""
    return tag("div", made, class_="scroll", tabindex=0, role="region", aria_label=name)


def figure(value: float | None, factor: float = 1) -> Html:
    """A cell with a number; a dash for None."""
    return tag("td", _text(value, factor) or "–")


def _cell(text: str | None, value: float | None, best: bool) -> Html:
    if text is None or value is None:
        return tag("td", "–")
    return tag("td", tag("strong", text) if best else text, data_value=repr(float(value)))


def _text(value: float | None, factor: float) -> str | None:
    if value is None:
        return None
    tiny = factor == 2**-20 and value < 512  # bytes that are no part of a MiB worth mention
    return "0" if tiny else verdict.significant(value * factor, 3)


def _times(study: Study) -> list[_Column]:
    picks: list[tuple[str, Callable[[int], Times | None]]] = [
        (f"{study.family} GPU ms", lambda i: study.results[i].gpu_ms),
        ("frame GPU ms", lambda i: study.results[i].frame_ms),
        ("host ms", lambda i: study.results[i].host_ms),
    ]
    columns = []
    for group, pick in picks:
        found = [pick(i) for i in range(len(study.results))]
        parts: dict[str, list[float | None]] = {
            "median": [t.median if t else None for t in found],
            "min": [t.min if t else None for t in found],
            "p95": [t.p95 if t else None for t in found],
        }
        columns += [
            _Column(
                group,
                name,
                values,
                [_text(v, 1) for v in values],
                _best("less", study, values) if name == "median" else frozenset(),
            )
            for name, values in parts.items()
            if any(v is not None for v in values)
        ]
    return columns


def _memory(study: Study) -> list[_Column]:
    values = [result.memory_bytes for result in study.results]
    if all(v is None for v in values):
        return []
    return [_Column("memory", "MiB", values, [_text(v, 2**-20) for v in values], _best("less", study, values))]


def _errors(study: Study) -> list[_Column]:
    columns = []
    for kind in study.kinds:
        for metric in verdict.METRICS:
            values = [result.errors.get(kind, {}).get(metric.key) for result in study.results]
            if all(v is None for v in values):
                continue
            texts = [_text(v, 100 if metric.unit == "%" else 1) for v in values]
            known = [verdict.judged_error(result, kind, metric.key) for result in study.results]
            texts = [str(e).removesuffix("\u00a0%") if e and e.hidden else t for e, t in zip(known, texts, strict=True)]
            best = _best(metric.better, study, [e.rank if e else None for e in known])
            unit = f" {metric.unit}" if metric.unit in ("%", "dB") else ""
            columns.append(_Column(f"error: {verdict.kind_name(kind)}", metric.name + unit, values, texts, best))
    return columns


def _best(better: str, study: Study, values: Sequence[float | None]) -> frozenset[int]:
    """The rows with the best value of a column, where techniques differ in it."""
    known = {
        i: _distance(better, value)
        for i, value in enumerate(values)
        if value is not None and study.results[i].technique != verdict.BASELINE
    }
    least = min(known.values(), default=0.0)
    best = frozenset(i for i, distance in known.items() if distance == least)
    return best if len(best) < len(known) else frozenset()


def _distance(better: str, value: float) -> float:
    """How far a metric's value is from where a perfect picture has it, up to a constant."""
    if better == "more":
        return -value
    return abs(value - 1) if better == "one" else abs(value)
