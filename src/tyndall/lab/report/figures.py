"""The figures that hold pictures: the large one with its divider, maps of the error, close-ups."""

from __future__ import annotations

from collections.abc import Sequence

from tyndall.lab.report import verdict
from tyndall.lab.report.images import TRUTH, Images
from tyndall.lab.report.markup import Html, join, tag
from tyndall.lab.report.results import Study
from tyndall.lab.report.setup import facts_list

_SHORT = {"inscattered": "air", "surfaces": "surfaces", "radiance": "whole"}


def pictures(study: Study, images: Images, prefix: str) -> Html:
    """The large picture under its divider, its controls, and all pictures in small."""
    first, second = images.opening

    def chooser(name: str, which: str, chosen: int) -> Html:
        options = [tag("option", n, value=i, selected=i == chosen) for i, n in enumerate(images.keys)]
        return tag("label", tag("span", name), tag("select", *options, data_role=which))

    def choice(name: str, role: str, values: Sequence[tuple[str, str]]) -> Html:
        buttons = [
            tag(
                "label",
                tag("input", type="radio", name=f"{prefix}-{role}", value=value, checked=i == 0, data_role=role),
                tag("span", text),
            )
            for i, (value, text) in enumerate(values)
        ]
        return tag("fieldset", tag("legend", name, class_="quiet"), *buttons, class_="choice")

    shows = [("picture", "picture")] + [(kind, f"error: {_SHORT.get(kind, kind)}") for kind in images.maps]
    light = None
    if images.light:
        curves = [("aces", "ACES"), ("agx", "AgX"), ("none", "sRGB, clipped")]
        options = [tag("option", text, value=value, selected=value == study.tonemap) for value, text in curves]
        light = join(
            tag(
                "label",
                tag("span", "Exposure"),
                tag(
                    "input",
                    type="range",
                    min=-8,
                    max=8,
                    step=0.1,
                    value=0,
                    data_role="exposure",
                    aria_label="Exposure in EV, relative to the camera’s",
                ),
                tag("output", "±0 EV", data_role="exposed"),
            ),
            tag("label", tag("span", "Tone curve"), tag("select", *options, data_role="tone")),
        )
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
        tag(
            "div",
            tag("span"),
            role="slider",
            tabindex=0,
            data_role="divider",
            class_="divider",
            aria_label="Divider between the left and the right picture",
            aria_valuemin=0,
            aria_valuemax=100,
            aria_valuenow=50,
            aria_orientation="horizontal",
        ),
        tag("span", tag("span"), tag("i"), tag("span"), data_role="scale", class_="scale", hidden=True),
        tag("span", "Click the picture first, then the wheel zooms", data_role="hint", class_="hint", hidden=True),
        tabindex=0,
        role="group",
        data_role="stage",
        class_="stage script",
        aria_describedby=f"{prefix}-keys",
        aria_label="Picture under a divider; keys: plus and minus zoom, arrows move, numbers choose the left picture",
        style=f"--aspect:{images.size[0] / images.size[1]:.5f}",
    )
    strip = tag(
        "ul",
        *(
            tag(
                "li",
                tag(
                    "figure",
                    tag(
                        "img",
                        src=uri,
                        alt=_alt(study, key),
                        width=images.size[0],
                        height=images.size[1],
                        data_picture=i,
                    ),
                    tag("figcaption", key, tag("small", _figures(study, key))),
                ),
            )
            for i, (key, uri) in enumerate(zip(images.keys, images.uris, strict=True))
        ),
        class_="strip",
        aria_label="All pictures",
    )
    keys = tag(
        "details",
        tag("summary", "Keys, mouse and touch"),
        facts_list(
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


def errors(study: Study, images: Images, prefix: str) -> Html:
    """The error maps of every kind of light, each kind with its colour bar."""
    if not images.maps:
        return tag(
            "section",
            tag("h2", "Where the error is"),
            tag("p", "There is no truth here to measure an error against.", class_="note"),
            id=f"{prefix}-errors",
        )
    figures = []
    for number, (kind, maps) in enumerate(images.maps.items()):
        low, high = verdict.percent(maps.scale.low), verdict.percent(maps.scale.high)
        what = f"Error of the {verdict.kind_name(kind)}"
        noise = ", whose own noise is in it" if TRUTH in maps.uris else ""
        told = (
            f"{what}, pixel by pixel, against the truth{noise}; one scale for all. Point at a pixel, or move by the "
            "arrow keys, to read it in every map."
        )
        cells = [
            _map(
                images,
                f"{prefix}-map-{number}-{i}",
                label,
                uri,
                f"{verdict.kind_name(kind)}, from {low} (black) to {high} (cream)",
            )
            for i, (label, uri) in enumerate(maps.uris.items())
        ]
        ramp = tag(
            "div",
            class_="ramp",
            data_role="ramp",
            role="img",
            aria_label=f"Colour bar, logarithmic, from {low} (black) to {high} (cream)",
        )
        ticks = [
            tag("span", verdict.percent(value, 1), style=f"left:{100 * at:.2f}%") for value, at in maps.scale.ticks()
        ]
        axis = tag("p", f"{what}, % of the truth’s mean", class_="axis")
        figures.append(
            tag(
                "figure",
                tag("div", axis, ramp, tag("div", *ticks, class_="ticks"), class_="bar-of-colours"),
                tag("div", *cells, class_="grid", style=f"--columns:{len(cells) if len(cells) < 5 else 3}"),
                tag("figcaption", told),
                class_="maps",
                data_kind=kind,
            )
        )
    return tag("section", tag("h2", "Where the error is"), *figures, id=f"{prefix}-errors")


def _map(images: Images, id: str, label: str, uri: str, meaning: str) -> Html:
    """One error map, or that of the truth's standard error; ``meaning`` is of its light and colours."""
    what = "the standard error of the truth" if label == TRUTH else f"the error of {label}"
    width, height = images.size
    return tag(
        "figure",
        tag(
            "img",
            src=uri,
            width=width,
            height=height,
            tabindex=0,
            alt=f"Map of {what}: {meaning}",
            id=id,
            data_map=label,
        ),
        tag(
            "figcaption",
            tag("span", "the truth’s own standard error" if label == TRUTH else label),
            tag("output", data_role="value"),
        ),
    )


def crops(study: Study, images: Images, prefix: str) -> Html:
    """The same few pixels of every picture, side by side."""
    rows = []
    for number, (place, uris) in enumerate(images.crops, 1):
        where = f"{place.width}×{place.height} pixels at ({place.x}, {place.y})"
        cells = [
            tag(
                "figure",
                tag("img", src=uri, alt=f"{key}, {where}", width=place.width, height=place.height, data_picture=i),
                tag("figcaption", key),
            )
            for i, (key, uri) in enumerate(zip(images.keys, uris, strict=True))
        ]
        head = tag("h3", f"Place {number} ", tag("small", where))
        rows.append(tag("div", head, tag("div", *cells, class_="crops"), class_="place", data_place=number - 1))
    chosen = "Where the techniques differ most from the truth" if study.reference else "The middle of the picture"
    text = f"{chosen}, magnified without smoothing; exposure and “Show” above hold here too. "
    text += "Click the large picture for a place of your own."
    return tag(
        "section", tag("h2", "Close up"), tag("p", text, class_="note"), *rows, id=f"{prefix}-crops", class_="closeup"
    )


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
