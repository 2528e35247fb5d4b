"""Plots put each value where it belongs, and can be read by anyone."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree

import pytest

from tyndall.lab.plots import Dots, Lines

SVG = "{http://www.w3.org/2000/svg}"
DOTS = Dots(
    title="Time & <light>",
    description="Milliseconds.",
    unit="ms",
    kinds=("here", "there"),
    groups=[("box", [("froxel", (0.1, 1.0)), ("march", (10.0, None))]), ("blinds", [("froxel", (1.0, 10.0))])],
)
LINES = Lines(
    title="Memory",
    description="MiB.",
    across="lights",
    unit="MiB",
    places=(1, 2, 4),
    series={"froxel": (10, 20, 40), "off": (0, 0, 0), "march": (1, 10, 100)},
)


def circles(svg: str) -> dict[str, tuple[float, float]]:
    """Where each dot is, by what it says of itself."""
    found = {}
    for circle in ElementTree.fromstring(svg).iter(f"{SVG}circle"):
        title = circle.find(f"{SVG}title")
        if title is not None:
            found[str(title.text)] = float(circle.attrib["cx"]), float(circle.attrib["cy"])
    return found


def test_equal_ratios_are_equal_distances() -> None:
    found = circles(DOTS.svg())
    assert set(found) == {
        "box, froxel, here: 0.1 ms",
        "box, froxel, there: 1 ms",
        "box, march, here: 10 ms",
        "blinds, froxel, here: 1 ms",
        "blinds, froxel, there: 10 ms",
    }
    tenth, one, ten = (
        found[f"{name} ms"][0] for name in ("box, froxel, here: 0.1", "box, froxel, there: 1", "box, march, here: 10")
    )
    assert one - tenth == pytest.approx(ten - one, abs=0.11)
    assert found["blinds, froxel, here: 1 ms"][0] == pytest.approx(one)
    assert found["blinds, froxel, here: 1 ms"][1] > found["box, march, here: 10 ms"][1]


def test_lines_rise_with_their_values_and_zero_is_left_out() -> None:
    found = circles(LINES.svg())
    assert not any(name.startswith("off") for name in found)
    (x1, y1), (x2, y2), (x4, y4) = (found[f"froxel: {v} MiB"] for v in (10, 20, 40))
    assert x2 - x1 == pytest.approx(x4 - x2, abs=0.11)
    assert y1 - y2 == pytest.approx(y2 - y4, abs=0.11)
    assert y1 > y2, "more is higher"
    steep = [found[f"march: {v} MiB"][1] for v in (1, 10, 100)]
    assert (steep[0] - steep[1]) / (y1 - y2) == pytest.approx(math.log(10) / math.log(2), rel=0.02)


@pytest.mark.parametrize("plot", [DOTS, LINES], ids=["dots", "lines"])
def test_a_plot_says_what_it_is_and_stays_inside_its_frame(plot: Dots | Lines) -> None:
    svg = plot.svg()
    root = ElementTree.fromstring(svg)
    assert root.attrib["role"] == "img"
    assert root.attrib["aria-label"] == plot.title
    assert root.find(f"{SVG}desc") is not None
    assert "prefers-color-scheme: dark" in svg
    assert "http" not in svg.replace("http://www.w3.org/2000/svg", ""), "nothing is fetched"
    width, height = (float(root.attrib[name]) for name in ("width", "height"))
    for x, y in circles(svg).values():
        assert 0 < x < width
        assert 0 < y < height
    labels = [(float(y), text) for y, text in re.findall(r'<text x="604[^"]*" y="([\d.]+)"[^>]*>([^<]+)', svg)]
    gaps = [b - a for (a, _), (b, _) in zip(sorted(labels), sorted(labels)[1:], strict=False)]
    assert all(gap >= 14 for gap in gaps), "names at the lines' ends do not overlap"
    assert svg == plot.svg()


def test_nothing_to_show_is_no_error() -> None:
    empty = Lines(title="t", description="d", across="x", unit="u", places=(1, 2), series={"off": (0, 0)})
    assert ElementTree.fromstring(empty.svg()) is not None
