"""The report as one HTML text: everything that needs no script is in it as text, tables and pictures."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from importlib import resources
from string import Template
from typing import Any

from tyndall.lab.report import verdict
from tyndall.lab.report.cost import cost
from tyndall.lab.report.figures import crops, errors, pictures
from tyndall.lab.report.heat import colour_map
from tyndall.lab.report.images import Images
from tyndall.lab.report.markup import Html, data, join, tag
from tyndall.lab.report.results import Milliseconds, Study
from tyndall.lab.report.setup import effort, facts_list, glossary, setup
from tyndall.lab.report.table import COLOURS, scroll, table

ANCHORS = {
    "pictures": "Pictures",
    "errors": "Errors",
    "crops": "Close-ups",
    "cost": "Cost",
    "table": "Figures",
    "setup": "Setup",
}  # of a comparison
_SCRIPTS = ("base.js", "light.js", "viewer.js", "maps.js", "crops.js", "plots.js", "sweep.js", "main.js")


def page(
    title: str, parts: Sequence[tuple[str, Html]], anchors: Mapping[str, str], overview: Html | None = None
) -> str:
    """The whole file.

    Args:
        title: of the page.
        parts: one or more articles, by name; of several, a selector shows one at a time.
        anchors: where the bar leads inside an article: what it says, by the end of the section's id.
        overview: what stands before them.
    """
    colours = ["#" + bytes(colour).hex() for colour in colour_map()]
    selector = None
    if len(parts) > 1:
        options = [tag("option", name, value=f"c{i}") for i, (name, _) in enumerate(parts)]
        selector = tag("label", tag("span", "Scene"), tag("select", *options, id="which"), class_="which script")
    links = [tag("a", text, href=f"#{name}", data_anchor=name) for name, text in anchors.items()]
    links.append(tag("a", "Glossary", href="#glossary"))
    body = join(
        tag(
            "header",
            tag("span", "Tyndall", class_="brand"),
            selector,
            tag("nav", *links, aria_label="Parts"),
            tag("button", "Theme: auto", type="button", id="theme", class_="script"),
            class_="bar",
        ),
        tag("main", overview, *(part for _, part in parts), glossary(), id="main"),
        tag("footer", "One file, made by Tyndall: it holds its pictures and asks nothing of the network."),
        data(
            {
                "palette": colours,
                "metrics": {m.key: {"name": m.name, "unit": m.unit, "better": m.better} for m in verdict.METRICS},
                "kinds": verdict.KINDS,
                "colours": COLOURS,
            },
            id="shared",
        ),
    )
    script = "\n".join(_asset(name) for name in _SCRIPTS)
    style = f":root {{ --ramp: linear-gradient(90deg, {', '.join(colours[::5])}); }}\n{_asset('report.css')}"
    return Template(_asset("report.html")).substitute(title=tag("title", title), style=style, script=script, body=body)


def comparison(study: Study, images: Images, number: int, heading: str = "h1") -> Html:
    """One comparison as an article; its pictures and data lie in it too, so that a script finds them by its number."""
    prefix = f"c{number}"
    return tag(
        "article",
        _head(study, heading),
        pictures(study, images, prefix),
        errors(study, images, prefix),
        crops(study, images, prefix),
        cost(study, prefix),
        table(study, prefix),
        setup(study, prefix),
        data(_plain(study, images), class_="data"),
        *(
            tag("script", Html(base64.b64encode(light).decode()), type="text/plain", id=f"{prefix}-light-{i}")
            for i, light in enumerate(images.light)
        ),
        id=prefix,
        class_="comparison",
        aria_label=f"Comparison: {study.scene}",
    )


def overview(studies: Sequence[Study]) -> Html:
    """A table of all comparisons: the error and the time of each technique in each."""
    labels = list(dict.fromkeys(result.label for study in studies for result in study.results))
    rows = []
    for number, study in enumerate(studies):
        judged = verdict.main_metric(study)
        best = verdict.best(study)
        cells = []
        for label in labels:
            result = next((r for r in study.results if r.label == label), None)
            if result is None:
                cells.append(tag("td", "–"))
                continue
            error = verdict.judged_error(result, *judged) if judged else None
            cells.append(
                tag(
                    "td",
                    tag("strong", str(error)) if error else "–",
                    tag("br"),
                    tag("small", verdict.milliseconds(result.gpu_ms.median) if result.gpu_ms else "not timed"),
                    class_="front" if label in best else None,
                )
            )
        name = tag("a", study.scene, href=f"#c{number}", data_open=f"c{number}")
        width, height = study.size
        place = tag("small", f"{study.folder.name}, {width}×{height}")
        rows.append(tag("tr", tag("th", name, tag("br"), place, scope="row"), *cells))
    head = tag("tr", tag("th", "scene", scope="col"), *(tag("th", label, scope="col") for label in labels))
    return tag(
        "section",
        tag("h1", f"{len(studies)} comparisons"),
        tag(
            "p",
            "Error and GPU time of each technique in each scene; marked: on the scene’s Pareto front of both.",
            class_="lead",
        ),
        scroll(tag("table", tag("thead", head), tag("tbody", *rows)), "All comparisons"),
        class_="overview",
    )


def _head(study: Study, heading: str) -> Html:
    width, height = study.size
    truth = study.reference
    facts = [("Size", f"{width}×{height}"), ("Adapter", study.adapter)]
    if study.triangles is not None:
        facts.insert(1, ("Triangles", f"{study.triangles:,}"))
    if truth:
        facts.append(("Truth", ", ".join([truth.judge, *effort(truth)])))
        facts += [
            (f"Its standard error, {verdict.kind_name(kind)}", verdict.percent(noise))
            for kind, noise in truth.relative_error.items()
            if noise
        ]
    else:
        facts.append(("Truth", "none was asked for"))
    return tag(
        "header",
        tag(heading, study.scene),
        tag("p", verdict.verdict(study), class_="lead"),
        tag("p", " ".join(verdict.remarks(study)), class_="remarks"),
        facts_list(facts, "facts"),
        class_="opening",
    )


def _plain(study: Study, images: Images) -> dict[str, Any]:
    """What the scripts draw from."""

    def times(value: Milliseconds | None) -> dict[str, float] | None:
        return value.model_dump(exclude_none=True) if value else None

    return {
        "scene": study.scene,
        "family": study.family,
        "size": images.size,
        "exposure": study.exposure or 0.0,
        "tone": study.tonemap,
        "pictures": images.keys,
        "light": bool(images.light),
        "opening": images.opening,
        "maps": {
            kind: {"low": maps.scale.low, "high": maps.scale.high, "labels": list(maps.uris)}
            for kind, maps in images.maps.items()
        },
        "places": [[p.x, p.y, p.width, p.height] for p, _ in images.crops],
        "patch": images.patch,
        "judged": verdict.main_metric(study),
        "noise": dict(study.reference.relative_error) if study.reference else {},
        "results": [
            {
                "label": r.label,
                "baseline": r.technique == verdict.BASELINE,
                "gpu": times(r.gpu_ms),
                "frame": times(r.frame_ms),
                "memory": r.memory_bytes,
                "errors": r.errors,
                "passes": [[name, t.median] for name, t in r.passes.items() if name != "frame"],
                "owners": list(r.memory.items()),
            }
            for r in study.results
        ],
    }


def _asset(name: str) -> str:
    return (resources.files(__package__) / name).read_text(encoding="utf-8")
