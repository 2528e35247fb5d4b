"""The plots of cost: against error with the Pareto front, by pass, and in memory; each with its data as a table."""

from __future__ import annotations

from collections.abc import Sequence

from tyndall.lab.report import verdict
from tyndall.lab.report.markup import Html, tag
from tyndall.lab.report.results import Study
from tyndall.lab.report.table import figure, scroll


def cost(study: Study, prefix: str) -> Html:
    """Cost against error, passes, memory; the plots themselves are drawn by plots.js."""
    passes = _bars(
        "passes",
        "Where the time goes",
        "GPU milliseconds of each pass, median. Short names are the technique’s own passes; the rest of the frame, in "
        "grey, is the same for all but for noise.",
        _table("Passes", ("technique", "pass", "ms"), _passes(study)),
    )
    memory = _bars(
        "memory",
        "Memory",
        "MiB on the device by owner; in grey what the technique does not own.",
        _table("Memory", ("technique", "owner", "MiB"), _memory(study)),
    )
    timed = any(result.passes for result in study.results)
    return tag(
        "section",
        tag("h2", "Time against error"),
        _scatter(study),
        tag("div", passes if timed else None, memory, class_="pair"),
        id=f"{prefix}-cost",
        class_="cost",
    )


def _scatter(study: Study) -> Html:
    pickers = _pickers(study)
    has_baseline = any(result.technique == verdict.BASELINE for result in study.results)
    return tag(
        "figure",
        tag("div", *pickers, class_="tools script") if pickers else None,
        tag("div", data_role="scatter", class_="plot script"),
        tag(
            "figcaption",
            "Down and left is better. The line is the Pareto front: no technique is both cheaper and more accurate "
            "than one on it. Whiskers reach from the least disturbed frame to the 95th percentile; an arrow down marks "
            "an error that the truth’s noise hides, drawn at what it may be at most; hatched is that noise, where it "
            "is in the error. ",
            "The dashed line is drawing no light at all. " if has_baseline else None,
            "A point opens its picture against the truth.",
            class_="script",
        ),
        _table("Cost against error", ("technique", "GPU ms", "error", "on the front"), _points(study)),
    )


def _pickers(study: Study) -> list[Html]:
    """What the plot's axes show."""
    judged = verdict.main_metric(study)
    if judged is None:
        return []
    scores = [score for result in study.results for score in result.errors.values()]
    known = {key for score in scores for key, value in score.items() if value is not None}
    metrics = [m for m in verdict.METRICS if m.key in known and m.key != "best_scale"]
    costs = [("gpu", "GPU time of the technique"), ("frame", "GPU time of the frame"), ("memory", "memory")]
    choices = [
        ("Light", "kind", [(kind, verdict.kind_name(kind)) for kind in study.kinds], judged[0]),
        ("Error", "metric", [(m.key, m.name) for m in metrics], judged[1]),
        ("Cost", "cost", [pair for pair in costs if _has_cost(study, pair[0])], "gpu"),
    ]
    made = []
    for text, role, pairs, chosen in choices:
        options = [tag("option", name, value=value, selected=value == chosen) for value, name in pairs]
        made.append(tag("label", tag("span", text), tag("select", *options, data_role=role)))
    return made


def _bars(role: str, title: str, caption: str, data: Html) -> Html:
    box = tag("input", type="checkbox", data_role=f"{role}-all")
    return tag(
        "figure",
        tag("h3", title),
        tag("div", tag("label", box, tag("span", "with the rest of the frame")), class_="tools script"),
        tag("div", data_role=role, class_="plot script"),
        tag("figcaption", caption),
        data,
    )


def _table(name: str, heads: Sequence[str], rows: Sequence[Html]) -> Html:
    """A plot's data for those who do not see it, or want the numbers."""
    head = tag("tr", *(tag("th", text, scope="col") for text in heads))
    made = tag("table", tag("thead", head), tag("tbody", *rows))
    return tag("details", tag("summary", "The plot’s data as a table"), scroll(made, name))


def _points(study: Study) -> list[Html]:
    judged, best, rows = verdict.main_metric(study), verdict.best(study), []
    for result in study.results:
        error = verdict.judged_error(result, *judged) if judged else None
        time = figure(result.gpu_ms.median if result.gpu_ms else None)
        known = tag("td", str(error) if error else "–")
        front = tag("td", "yes" if result.label in best else "no")
        rows.append(tag("tr", tag("th", result.label, scope="row"), time, known, front))
    return rows


def _passes(study: Study) -> list[Html]:
    return [
        tag("tr", tag("th", result.label, scope="row"), tag("td", name, class_="text"), figure(times.median))
        for result in study.results
        for name, times in result.passes.items()
    ]


def _memory(study: Study) -> list[Html]:
    return [
        tag("tr", tag("th", r.label, scope="row"), tag("td", owner, class_="text"), figure(size, 2**-20))
        for r in study.results
        for owner, size in (r.memory or {study.family: r.memory_bytes or 0.0}).items()
    ]


def _has_cost(study: Study, cost: str) -> bool:
    values = {"gpu": "gpu_ms", "frame": "frame_ms", "memory": "memory_bytes"}
    return any(getattr(r, values[cost]) is not None for r in study.results)
