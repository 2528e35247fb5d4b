"""The report as one HTML text: everything that needs no script is in it as text, tables and pictures."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from string import Template
from typing import Any

from tyndall.lab.report import verdict
from tyndall.lab.report.heat import colour_map
from tyndall.lab.report.images import TRUTH, Images
from tyndall.lab.report.markup import Html, data, join, tag
from tyndall.lab.report.results import Milliseconds, Reference, Result, Study
from tyndall.lab.report.table import COLOURS, figure, scroll, table

ANCHORS = {
    "pictures": "Pictures",
    "errors": "Errors",
    "crops": "Close-ups",
    "cost": "Cost",
    "table": "Figures",
    "setup": "Setup",
}  # of a comparison
_LONG = 44  # characters; a longer fact has two columns
_SHORT = {"inscattered": "air", "surfaces": "surfaces", "radiance": "whole"}
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
    selector = None
    if len(parts) > 1:
        options = [tag("option", name, value=f"c{i}") for i, (name, _) in enumerate(parts)]
        selector = tag("label", tag("span", "Scene"), tag("select", *options, id="which"), class_="which script")
    links = [tag("a", text, href=f"#{name}", data_anchor=name) for name, text in anchors.items()]
    links.append(tag("a", "Glossary", href="#glossary"))
    body = join(
        tag("header", tag("span", "Tyndall", class_="brand"), selector, tag("nav", *links, aria_label="Parts"),
            tag("button", "Theme: auto", type="button", id="theme", class_="script"), class_="bar"),
        tag("main", overview, *(part for _, part in parts), _glossary(), id="main"),
        tag("footer", "One file, made by Tyndall: it holds its pictures and asks nothing of the network."),
        data({"palette": ["#" + bytes(c).hex() for c in colour_map()],
              "metrics": {m.key: {"name": m.name, "unit": m.unit, "better": m.better} for m in verdict.METRICS},
              "kinds": verdict.KINDS, "colours": COLOURS}, id="shared"),
    )  # fmt: skip
    script = "\n".join(_asset(name) for name in _SCRIPTS)
    colours = ["#" + bytes(colour).hex() for colour in colour_map()]
    style = f":root {{ --ramp: linear-gradient(90deg, {', '.join(colours[::5])}); }}\n{_asset('report.css')}"
    for name, text in (("script", script), ("style", style)):
        if f"</{name}" in text:
            raise AssertionError(f"the {name} would end its own element")
    return Template(_asset("report.html")).substitute(title=tag("title", title), style=style, script=script, body=body)


def comparison(study: Study, images: Images, number: int, heading: str = "h1") -> Html:
    """One comparison as an article; its pictures and data lie in it too, so that a script finds them by its number."""
    prefix = f"c{number}"
    return tag(
        "article",
        _head(study, heading),
        _pictures(study, images, prefix),
        _errors(study, images, prefix),
        _crops(study, images, prefix),
        _cost(study, prefix),
        table(study, prefix),
        _setup(study, prefix),
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
                tag("td", tag("strong", str(error)) if error else "–", tag("br"),
                    tag("small", verdict.milliseconds(result.gpu_ms.median) if result.gpu_ms else "not timed"),
                    class_="front" if label in best else None)
            )  # fmt: skip
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
        facts.append(("Truth", ", ".join([truth.judge, *_effort(truth)])))
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
        _list(facts, "facts"),
        class_="opening",
    )


def _pictures(study: Study, images: Images, prefix: str) -> Html:
    names = [TRUTH if key == TRUTH else key for key in images.keys]
    first, second = images.opening

    def chooser(name: str, which: str, chosen: int) -> Html:
        options = [tag("option", n, value=i, selected=i == chosen) for i, n in enumerate(names)]
        return tag("label", tag("span", name), tag("select", *options, data_role=which))

    def choice(name: str, role: str, values: Sequence[tuple[str, str]]) -> Html:
        buttons = [
            tag("label", tag("input", type="radio", name=f"{prefix}-{role}", value=value, checked=i == 0,
                             data_role=role), tag("span", text))
            for i, (value, text) in enumerate(values)
        ]  # fmt: skip
        return tag("fieldset", tag("legend", name, class_="quiet"), *buttons, class_="choice")

    shows = [("picture", "picture")] + [(kind, f"error: {_SHORT.get(kind, kind)}") for kind in images.maps]
    light = None
    if images.light:
        curves = [("aces", "ACES"), ("agx", "AgX"), ("none", "sRGB, clipped")]
        options = [tag("option", text, value=value, selected=value == study.tonemap) for value, text in curves]
        light = join(
            tag("label", tag("span", "Exposure"),
                tag("input", type="range", min=-8, max=8, step=0.1, value=0, data_role="exposure",
                    aria_label="Exposure in EV, relative to the camera’s"),
                tag("output", "±0 EV", data_role="exposed")),
            tag("label", tag("span", "Tone curve"), tag("select", *options, data_role="tone")),
        )  # fmt: skip
    tools = tag(
        "div",
        chooser("Left", "left", first),
        tag("button", "⇄", type="button", data_role="swap", aria_label="Swap left and right", title="Swap (X)"),
        chooser("Right", "right", second),
        choice("Show", "show", shows) if len(shows) > 1 else None,
        light,
        tag(
            "label",
            tag("input", type="checkbox", checked=True, data_role="frames"),
            tag("span", "Frames of the close-ups"),
        ),
        tag(
            "span",
            tag("button", "−", type="button", data_role="out", aria_label="Zoom out", title="Zoom out (−)"),
            tag("output", data_role="zoom", aria_label="Zoom"),
            tag("button", "+", type="button", data_role="in", aria_label="Zoom in", title="Zoom in (+)"),
            tag("button", "Fit", type="button", data_role="fit", title="Whole picture (0)"),
            class_="group",
        ),
        class_="tools script",
    )
    stage = tag(
        "div",
        tag("canvas", role="img", data_role="canvas", aria_label="The two pictures"),
        tag("span", data_role="name-left", class_="name left"),
        tag("span", data_role="name-right", class_="name right"),
        tag("div", tag("span"), role="slider", tabindex=0, data_role="divider", class_="divider",
            aria_label="Divider between the left and the right picture", aria_valuemin=0, aria_valuemax=100,
            aria_valuenow=50, aria_orientation="horizontal"),
        tag("span", tag("span"), tag("i"), tag("span"), data_role="scale", class_="scale", hidden=True),
        tag("span", "Click the picture first, then the wheel zooms", data_role="hint", class_="hint", hidden=True),
        tabindex=0, role="group", data_role="stage", class_="stage script", aria_describedby=f"{prefix}-keys",
        aria_label="Picture under a divider; keys: plus and minus zoom, arrows move, numbers choose the left picture",
        style=f"--aspect:{images.size[0] / images.size[1]:.5f}",
    )  # fmt: skip
    strip = tag(
        "ul",
        *(
            tag("li", tag("figure",
                tag("img", src=uri, alt=_alt(study, key), width=images.size[0], height=images.size[1],
                    data_picture=i),
                tag("figcaption", key, tag("small", _figures(study, key)))))
            for i, (key, uri) in enumerate(zip(images.keys, images.uris, strict=True))
        ),
        class_="strip",
        aria_label="All pictures",
    )  # fmt: skip
    keys = tag(
        "details",
        tag("summary", "Keys, mouse and touch"),
        _list(
            [
                ("← →", "move the divider when it has the focus (with Shift in larger steps; Home, End)"),
                ("+ − 0", "zoom in, zoom out, whole picture, when the picture has the focus; its arrows move it"),
                ("1 … 9", "choose the left picture; with Shift the right one"),
                ("X", "swap left and right: hold it in one place and flip"),
                ("wheel, pinch", "zoom where the pointer is; drag to move the picture or the divider"),
                ("click", "take the close-up below from this place"),
            ],
            "keys",
        ),
        id=f"{prefix}-keys",
        class_="script",
    )
    return tag(
        "section",
        tag("h2", "Pictures"),
        tools,
        stage,
        tag("p", "Move the pointer over the picture to read its values.", data_role="values", class_="values script"),
        strip,
        tag("p", *(f"{note} " for note in images.notes), class_="note") if images.notes else None,
        keys,
        id=f"{prefix}-pictures",
        class_="viewer",
    )


def _errors(study: Study, images: Images, prefix: str) -> Html:
    if not images.maps:
        return tag("section", tag("h2", "Where the error is"),
                   tag("p", "There is no truth here to measure an error against.", class_="note"),
                   id=f"{prefix}-errors")  # fmt: skip
    figures = []
    for number, (kind, maps) in enumerate(images.maps.items()):
        low, high = verdict.percent(maps.scale.low), verdict.percent(maps.scale.high)
        what = f"Error of the {verdict.kind_name(kind)}"
        cells = [
            tag("figure",
                tag("img", src=uri, width=images.size[0], height=images.size[1], tabindex=0,
                    alt=f"Map of {'the standard error of the truth' if label == TRUTH else f'the error of {label}'}: "
                    f"{verdict.kind_name(kind)}, from {low} (black) to {high} (cream)",
                    id=f"{prefix}-map-{number}-{i}", data_map=label),
                tag("figcaption", tag("span", "the truth’s own standard error" if label == TRUTH else label),
                    tag("output", data_role="value")))
            for i, (label, uri) in enumerate(maps.uris.items())
        ]  # fmt: skip
        ramp = tag("div", class_="ramp", data_role="ramp", role="img",
                   aria_label=f"Colour bar, logarithmic, from {low} (black) to {high} (cream)")  # fmt: skip
        figures.append(
            tag("figure",
                tag("div", tag("p", f"{what}, % of the truth’s mean", class_="axis"), ramp,
                    tag("div", *(tag("span", verdict.percent(v, 1), style=f"left:{100 * at:.2f}%")
                                for v, at in maps.scale.ticks()),
                        class_="ticks"), class_="bar-of-colours"),
                tag("div", *cells, class_="grid", style=f"--columns:{len(cells) if len(cells) < 5 else 3}"),
                tag("figcaption", f"{what}, pixel by pixel, against the truth"
                    f"{', whose own noise is in it' if TRUTH in maps.uris else ''}; one scale for all. Point at a pixel, or move by the arrow keys, to read it in every map."),
                class_="maps", data_kind=kind)
        )  # fmt: skip
    return tag("section", tag("h2", "Where the error is"), *figures, id=f"{prefix}-errors")


def _crops(study: Study, images: Images, prefix: str) -> Html:
    rows = []
    for number, (place, uris) in enumerate(images.crops, 1):
        where = f"{place.width}×{place.height} pixels at ({place.x}, {place.y})"
        cells = [
            tag("figure",
                tag("img", src=uri, alt=f"{key}, {where}", width=place.width, height=place.height, data_picture=i),
                tag("figcaption", key))
            for i, (key, uri) in enumerate(zip(images.keys, uris, strict=True))
        ]  # fmt: skip
        head = tag("h3", f"Place {number} ", tag("small", where))
        rows.append(tag("div", head, tag("div", *cells, class_="crops"), class_="place", data_place=number - 1))
    chosen = "Where the techniques differ most from the truth" if study.reference else "The middle of the picture"
    text = f"{chosen}, magnified without smoothing; exposure and “Show” above hold here too. "
    text += "Click the large picture for a place of your own."
    return tag(
        "section", tag("h2", "Close up"), tag("p", text, class_="note"), *rows, id=f"{prefix}-crops", class_="closeup"
    )


def _cost(study: Study, prefix: str) -> Html:
    kinds = study.kinds
    metrics = [m for m in verdict.METRICS if any(_score(r, k, m.key) is not None for r in study.results for k in kinds)]
    judged = verdict.main_metric(study)
    pickers = []
    if judged and len(kinds) > 1:
        options = [tag("option", verdict.kind_name(k), value=k, selected=k == judged[0]) for k in kinds]
        pickers.append(tag("label", tag("span", "Light"), tag("select", *options, data_role="kind")))
    if judged:
        plotted = [m for m in metrics if m.better in ("less", "more") or m.key in ("ssim", "bias")]
        options = [tag("option", m.name, value=m.key, selected=m.key == judged[1]) for m in plotted]
        pickers.append(tag("label", tag("span", "Error"), tag("select", *options, data_role="metric")))
        costs = [("gpu", "GPU time of the technique"), ("frame", "GPU time of the frame"), ("memory", "memory")]
        options = [tag("option", text, value=value) for value, text in costs if _has_cost(study, value)]
        pickers.append(tag("label", tag("span", "Cost"), tag("select", *options, data_role="cost")))
    has_baseline = any(result.technique == verdict.BASELINE for result in study.results)
    scatter = tag(
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
        tag("details", tag("summary", "The plot’s data as a table"), _scatter_table(study)),
    )
    bars = []
    for role, title, caption, rows, unit in (
        ("passes", "Where the time goes", "GPU milliseconds of each pass, median. Short names are the technique’s own "
         "passes; “rest of the frame” is the same for all but for noise.", _passes(study), "ms"),
        ("memory", "Memory", "MiB on the device by owner.", _memory(study), "MiB"),
    ):  # fmt: skip
        if not rows:
            continue
        bars.append(
            tag("figure", tag("h3", title),
                tag("div",
                    tag("label", tag("input", type="checkbox", data_role=f"{role}-all"),
                        tag("span", "with the rest of the frame")), class_="tools script"),
                tag("div", data_role=role, class_="plot script"),
                tag("figcaption", caption),
                tag("details", tag("summary", "The plot’s data as a table"),
                    scroll(tag("table", tag("thead", tag("tr", tag("th", "technique", scope="col"),
                        tag("th", "pass" if role == "passes" else "owner", scope="col"),
                        tag("th", unit, scope="col"))), tag("tbody", *rows)), title)))
        )  # fmt: skip
    return tag(
        "section",
        tag("h2", "Time against error"),
        scatter,
        tag("div", *bars, class_="pair") if bars else None,
        id=f"{prefix}-cost",
        class_="cost",
    )


def _scatter_table(study: Study) -> Html:
    judged = verdict.main_metric(study)
    rows = []
    best = verdict.best(study)
    for result in study.results:
        error = verdict.judged_error(result, *judged) if judged else None
        rows.append(
            tag("tr", tag("th", result.label, scope="row"), figure(result.gpu_ms.median if result.gpu_ms else None, 1),
                tag("td", str(error) if error else "–"), tag("td", "yes" if result.label in best else "no"))
        )  # fmt: skip
    head = tag("tr", *(tag("th", text, scope="col") for text in ("technique", "GPU ms", "error", "on the front")))
    return scroll(tag("table", tag("thead", head), tag("tbody", *rows)), "Cost against error")


def _passes(study: Study) -> list[Html]:
    return [
        tag("tr", tag("th", result.label, scope="row"), tag("td", name, class_="text"), figure(times.median, 1))
        for result in study.results
        for name, times in result.passes.items()
    ]


def _memory(study: Study) -> list[Html]:
    return [
        tag("tr", tag("th", r.label, scope="row"), tag("td", owner, class_="text"), figure(size, 2**-20))
        for r in study.results
        for owner, size in (r.memory or {study.family: r.memory_bytes or 0.0}).items()
    ]


def _setup(study: Study, prefix: str) -> Html:
    width, height = study.size
    facts: list[tuple[str, str | Html]] = [("Scene", study.scene), ("Picture", f"{width}×{height} pixels")]
    if study.triangles is not None:
        facts.append(("Triangles", f"{study.triangles:,}"))
    if study.scene_hash:
        facts.append(("Scene’s hash (SHA-256)", tag("code", study.scene_hash)))
    facts.append(("Adapter", study.adapter))
    if study.driver:
        facts.append(("Driver", study.driver))
    if study.versions:
        facts.append(("Versions", ", ".join(f"{name} {version}" for name, version in study.versions.items())))
    truth = None
    if study.reference:
        known = study.reference
        pairs: list[tuple[str, str | Html]] = [("Judge", known.judge)]
        pairs += [("Effort", text) for text in _effort(known)]
        if known.seconds is not None:
            pairs.append(("Time", f"{verdict.significant(known.seconds, 3)} s"))
        pairs += [
            (f"Standard error, {verdict.kind_name(kind)}", verdict.percent(noise))
            for kind, noise in known.relative_error.items()
            if noise
        ]
        pairs += [(key.replace("_", " "), _value(value)) for key, value in known.other.items()]
        truth = join(tag("h3", "Truth"), _list(pairs, "facts"))
    chosen = study.parameters.get(study.family)
    techniques = chosen if isinstance(chosen, dict) else {}
    shared = {k: v for k, v in study.parameters.items() if k != study.family}
    command = None
    if study.command:
        command = tag("div", tag("pre", tag("code", study.command)),
                      tag("button", "Copy", type="button", class_="copy script", aria_label="Copy the command"),
                      class_="command")  # fmt: skip
    return tag(
        "section",
        tag("h2", "Setup"),
        tag("h3", "Reproduce"),
        command or tag("p", "The command was not recorded.", class_="note"),
        _list(facts, "facts"),
        truth,
        tag("h3", "Parameters"),
        *(_parameters(name, value) for name, value in techniques.items()),
        *(_parameters(name, value) for name, value in shared.items()),
        *(
            join(tag("h3", title), _list(list(reasons.items()), "glossary"))
            for title, reasons in (("Left out", study.skipped), ("Without errors", study.missing))
            if reasons
        ),
        id=f"{prefix}-setup",
        class_="setup",
    )


def _effort(truth: Reference) -> list[str]:
    """How much work a truth is, in words: a march has steps, everything else samples."""
    if "steps" in truth.other:
        return [f"{truth.other['steps']} steps a pixel"]
    return [f"{truth.samples:,} samples a pixel"] if truth.samples else []


def _parameters(name: str, value: Any) -> Html:
    if not isinstance(value, Mapping):
        return tag("details", tag("summary", name.replace("_", " "), " ", tag("small", _value(value))))
    words = ", ".join(f"{k} {_value(v)}" for k, v in value.items() if k != "technique")
    chosen = value.get("technique")
    head = name if chosen in (None, name) else f"{name}: {chosen}"
    return tag("details", tag("summary", head, " ", tag("small", words)),
               _list([(str(k), _value(v)) for k, v in value.items()], "facts"))  # fmt: skip


def _glossary() -> Html:
    pairs = [(verdict.kind_name(kind), text) for kind, text in verdict.KIND_MEANINGS.items()]
    pairs += [(m.name, m.meaning) for m in verdict.METRICS]
    pairs += [
        (
            "GPU ms",
            "Time of the technique’s own passes by timestamp queries, so without the host: median of the frames.",
        ),
        ("host ms", "Time to encode and submit a frame on the CPU."),
        ("memory", "Bytes that the technique itself holds on the device, from the ledger of all resources."),
        ("truth’s standard error", "Root mean square of the standard error of its pixels over its mean."),
        ("Pareto front", "The techniques that no other beats in time without losing in error."),
        ("error map", "Per pixel: root mean square over the channels of the difference, over the truth’s mean."),
    ]
    return tag("section", tag("h2", "Glossary"), _list(pairs, "glossary"), id="glossary")


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


def _score(result: Result, kind: str, key: str) -> float | None:
    return result.errors.get(kind, {}).get(key)


def _has_cost(study: Study, cost: str) -> bool:
    values = {"gpu": "gpu_ms", "frame": "frame_ms", "memory": "memory_bytes"}
    return any(getattr(r, values[cost]) is not None for r in study.results)


def _alt(study: Study, key: str) -> str:
    return f"{study.scene}: the truth" if key == TRUTH else f"{study.scene} drawn by {key}"


def _figures(study: Study, key: str) -> str:
    """Time and error of a technique, for a caption."""
    result = next((r for r in study.results if r.label == key), None)
    if result is None:
        return study.reference.judge if study.reference else ""
    judged = verdict.main_metric(study)
    error = verdict.judged_error(result, *judged) if judged else None
    words = [verdict.milliseconds(result.gpu_ms.median)] if result.gpu_ms else []
    return " · ".join(words + ([str(error)] if error else []))


def _value(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list):
        return ", ".join(_value(v) for v in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {_value(v)}" for key, v in value.items())
    return json.dumps(value)


def _list(pairs: Sequence[tuple[str, str | Html]], kind: str) -> Html:
    rows = (
        tag("div", tag("dt", name), tag("dd", value), class_="long" if len(value) > _LONG else None)
        for name, value in pairs
    )
    return tag("dl", *rows, class_=kind)


def _asset(name: str) -> str:
    return (resources.files(__package__) / name).read_text(encoding="utf-8")
