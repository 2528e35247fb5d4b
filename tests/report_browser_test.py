"""The report in a browser: what moves moves, nothing is asked of the network, and everybody can use it.

A headless Chromium of the system, driven by Playwright; skipped where there is none (``apt-get install chromium``).
"""

from __future__ import annotations

import base64
import io
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from report_samples import (
    EXPOSURE,
    SCENE,
    SIZE,
    TECHNIQUES,
    developed,
    save_comparison,
    save_old_comparison,
    save_sweep,
)
from report_samples import room as lights_of

from tyndall.lab.report import write_report
from tyndall.lab.report.heat import colour_map

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chromium-browser"))), None)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here: apt-get install chromium")
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
LABELS = [label for label, _, _ in TECHNIQUES]
WIDTH, HEIGHT = SIZE

# The names of what a person can operate or look at, as a screen reader finds them.
UNNAMED = """() => {
  const text = (id) => document.getElementById(id)?.textContent.trim();
  const labelled = (e) => (e.getAttribute("aria-labelledby") ?? "").split(" ").map(text).join("");
  const labels = (e) => [...(e.labels ?? [])].map((l) => l.textContent.trim()).join("");
  const own = (e) => (e.tagName === "IMG" ? e.alt : e.textContent.trim());
  const all = "button, select, input, a, img, [tabindex], [role=img], [role=slider], summary";
  return [...document.querySelectorAll(all)]
    .filter((e) => !(e.getAttribute("aria-label") || labelled(e) || labels(e) || own(e))).map((e) => e.outerHTML);
}"""
SETTLED = """async () => {
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  const busy = () => document.querySelector('[aria-busy="true"]');
  do { await frame(); await frame(); await new Promise((done) => setTimeout(done, 30)); } while (busy());
}"""
COLOURS = """() => {
  const probe = document.body.appendChild(document.createElement("i"));
  const marks = Array.from({ length: 8 }, (_, i) => `k${i}`);
  const look = (name) => { probe.style.color = `var(--${name})`; return [name, getComputedStyle(probe).color]; };
  return Object.fromEntries(["paper", "sheet", "ink", "quiet", "accent", "mark", "edge", ...marks].map(look));
}"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Reports, by what is in them."""
    folder = tmp_path_factory.mktemp("pages")
    save_comparison(folder / "room")
    save_old_comparison(folder / "old")
    save_sweep(folder / "sweep")
    for name in ("a", "b"):
        save_comparison(folder / "several" / name, f"room {name}")
    return {name: write_report(folder / name) for name in ("room", "old", "several", "sweep")}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield launched
        launched.close()


class Opened:
    """A report in a tab, and what the tab said and asked for."""

    def __init__(self, browser: Any, path: Path, **options: Any) -> None:
        self.tab = browser.new_page(**{"viewport": {"width": 1200, "height": 900}, **options})
        self.said: list[str] = []
        self.asked: list[str] = []
        self.tab.set_default_timeout(20_000)
        self.tab.on("console", lambda message: self.said.append(message.text))
        self.tab.on("pageerror", lambda error: self.said.append(str(error)))
        self.tab.on("request", lambda request: self.asked.append(request.url))
        self.tab.goto(path.as_uri())
        self.settle()

    def settle(self) -> None:
        """Wait until what was set in motion has been decoded and drawn."""
        self.tab.evaluate(SETTLED)

    def pixels(self, selector: str = ".stage canvas") -> np.ndarray[Any, Any]:
        """(H, W, 3) of a canvas."""
        address = self.tab.eval_on_selector(selector, "(canvas) => canvas.toDataURL('image/png')")
        with Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))) as image:
            return np.asarray(image.convert("RGB"))

    def role(self, name: str) -> Any:
        return self.tab.locator(f'[data-role="{name}"]').first

    def stage(self) -> tuple[float, float, float, float]:
        """Left, top, width and height of the large picture, when all of it is in view."""
        self.tab.eval_on_selector(".stage", "(stage) => stage.scrollIntoView({ block: 'center', behavior: 'instant' })")
        self.settle()
        box = self.role("stage").bounding_box()
        return box["x"], box["y"], box["width"], box["height"]

    def text(self, name: str) -> str:
        return str(self.role(name).inner_text()).replace("\u00a0", " ")

    def close(self) -> None:
        self.tab.close()


@pytest.fixture
def room(browser: Any, pages: dict[str, Path]) -> Iterator[Opened]:
    opened = Opened(browser, pages["room"])
    yield opened
    opened.close()


def picture(pages: dict[str, Path], label: str) -> np.ndarray[Any, Any]:
    """The saved PNG of a technique or of the truth, (H, W, 3)."""
    with Image.open(pages["room"].parent / f"{label}.png") as image:
        return np.asarray(image)


def at_stage(pixels: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The pixel of a fitted stage at the middle of each pixel of the picture, (H, W, 3)."""
    height, width = pixels.shape[:2]
    scale = min(width / WIDTH, height / HEIGHT)
    x = ((np.arange(WIDTH) + 0.5) * scale + (width - WIDTH * scale) / 2).astype(int)
    y = ((np.arange(HEIGHT) + 0.5) * scale + (height - HEIGHT * scale) / 2).astype(int)
    return pixels[y][:, x]


def test_nothing_is_asked_of_the_network_and_nothing_goes_wrong(browser: Any, pages: dict[str, Path]) -> None:
    for path in pages.values():
        opened = Opened(browser, path)
        opened.tab.evaluate("window.scrollTo(0, document.body.scrollHeight)")
        opened.settle()
        assert opened.said == []
        assert [url for url in opened.asked if not url.startswith(("data:", "blob:"))] == [path.as_uri()]
        opened.close()


def test_a_page_cannot_fetch_even_if_it_wanted_to(room: Opened) -> None:
    answer = room.tab.evaluate("() => fetch('https://example.invalid/').then(() => 'sent', () => 'refused')")
    assert answer == "refused"
    assert "Content Security Policy" in room.said[0]
    assert len(room.asked) == 1 or all(not url.startswith("http") for url in room.asked)


def test_both_halves_are_the_pictures_that_were_saved(room: Opened, pages: dict[str, Path]) -> None:
    """The page develops light by its own curve: it must be the renderer's."""
    room.role("frames").uncheck()
    for split, label in (("End", "coarse"), ("Home", "truth")):
        room.role("divider").press(split)
        room.settle()
        saved = picture(pages, label if label != "truth" else "reference")
        shown = at_stage(room.pixels())
        # Light is kept to 0.4 %, which is two bytes of 255 at most where the curve is steep.
        assert np.abs(shown.astype(int) - saved).max() <= 2


def test_the_divider_follows_mouse_and_keys(room: Opened, pages: dict[str, Path]) -> None:
    room.role("frames").uncheck()
    divider, (left, top, width, height) = room.role("divider"), room.stage()
    before = room.pixels()
    assert divider.get_attribute("aria-valuenow") == "50"
    room.tab.mouse.move(left + width / 2, top + height / 3)
    room.tab.mouse.down()
    room.tab.mouse.move(left + width / 5, top + height / 3, steps=4)
    room.tab.mouse.up()
    room.settle()
    assert divider.get_attribute("aria-valuenow") == "20"
    after = room.pixels()
    changed = np.abs(after.astype(int) - before).sum(axis=(0, 2)) > 0
    columns = len(changed)
    assert changed[int(0.22 * columns) : int(0.48 * columns)].any(), "between the old place and the new one"
    assert not changed[: int(0.19 * columns)].any()
    assert not changed[int(0.51 * columns) :].any()

    for key, value in (("ArrowRight", 21), ("Shift+ArrowLeft", 11), ("PageUp", 21), ("End", 100), ("Home", 0)):
        divider.press(key)
        room.settle()
        assert divider.get_attribute("aria-valuenow") == str(value)
    assert "0 % coarse, the rest truth" in divider.get_attribute("aria-valuetext")


def test_selects_keys_and_pictures_choose_what_is_compared(room: Opened) -> None:
    room.role("left").select_option(label="fine")
    room.settle()
    assert (room.text("name-left"), room.text("name-right")) == ("fine", "truth")
    room.role("swap").click()
    room.settle()
    assert (room.text("name-left"), room.text("name-right")) == ("truth", "fine")
    room.tab.locator(".strip button").nth(3).click(modifiers=["Shift"])
    room.settle()
    assert (room.text("name-left"), room.text("name-right")) == ("truth", "fine")
    room.role("stage").press("3")
    room.settle()
    assert (room.text("name-left"), room.role("left").input_value()) == ("coarse", "2")
    pressed = room.tab.locator('.strip button[aria-pressed="true"] img').evaluate_all("all => all.map((i) => i.alt)")
    assert pressed == [f"{SCENE} drawn by coarse", f"{SCENE} drawn by fine"]


def test_exposure_is_a_factor_of_light(room: Opened, pages: dict[str, Path]) -> None:
    room.role("frames").uncheck()
    room.role("divider").press("Home")
    room.role("exposure").fill("-2")
    room.settle()
    wall, beam = lights_of(SIZE)
    assert np.abs(at_stage(room.pixels()).astype(int) - developed(wall + beam, EXPOSURE - 2)).max() <= 2
    assert room.text("exposed") == "−2.0 EV"
    room.role("tone").select_option("none")
    room.settle()
    x = np.clip((wall + beam) * 2 ** (EXPOSURE - 2), 0, 1)
    srgb = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)
    assert np.abs(at_stage(room.pixels()).astype(int) - 255 * srgb).max() <= 2


def test_zoom_keeps_pixels_crisp_and_the_place_under_the_pointer(room: Opened) -> None:
    room.role("frames").uncheck()
    for _ in range(6):
        room.role("in").click()
    room.settle()
    assert float(room.text("zoom").rstrip(" %")) > 800
    colours = len(np.unique(room.pixels()[:, : room.pixels().shape[1] // 2 - 3].reshape(-1, 3), axis=0))
    assert colours <= WIDTH * HEIGHT / 20, "a few pixels, and none mixed between them"
    room.role("stage").press("0")
    room.settle()
    left, top, width, height = room.stage()
    x, y = left + 0.25 * width, top + 0.4 * height
    room.tab.mouse.move(x, y)
    room.settle()
    before = room.text("values").splitlines()[0]
    room.tab.mouse.wheel(0, -480)
    room.settle()
    assert float(room.text("zoom").rstrip(" %")) > 1500
    room.tab.mouse.move(x, y)
    room.settle()
    assert room.text("values").splitlines()[0] == before


def test_the_wheel_scrolls_the_page_until_the_picture_is_chosen(room: Opened) -> None:
    left, top, _, _ = room.stage()
    zoom, before = room.text("zoom"), room.tab.evaluate("scrollY")
    room.tab.mouse.move(left + 50, top + 200)
    room.tab.mouse.wheel(0, 200)
    room.tab.wait_for_timeout(400)
    assert room.tab.evaluate("scrollY") > before
    assert room.text("zoom") == zoom
    assert room.role("hint").is_visible()


def test_a_click_takes_a_close_up_from_there(room: Opened, pages: dict[str, Path]) -> None:
    places = room.tab.locator(".place")
    before = places.count()
    left, top, width, height = room.stage()
    room.tab.mouse.click(left + 0.8 * width, top + 0.3 * height)
    room.settle()
    assert places.count() == before + 1
    heading = places.last.locator("h3").inner_text()
    assert heading.startswith("Your place")
    x, y = (int(v) for v in heading[heading.index("(") + 1 : -1].split(","))
    crop = room.pixels(f".place:nth-of-type({before + 1}) canvas")
    height, width = crop.shape[:2]
    assert abs(x + width / 2 - 0.8 * WIDTH) <= 1
    saved = picture(pages, "reference")[y : y + height, x : x + width]
    assert np.abs(crop.astype(int) - saved).max() <= 2


def test_close_ups_show_the_same_place_of_every_picture(room: Opened, pages: dict[str, Path]) -> None:
    heading = room.tab.locator(".place h3").first.inner_text()
    x, y = (int(v) for v in heading[heading.index("(") + 1 : -1].split(","))
    for i, label in enumerate(["reference", *LABELS]):
        room.settle()
        crop = room.pixels(f".place .crops figure:nth-of-type({i + 1}) canvas")
        saved = picture(pages, label)[y : y + crop.shape[0], x : x + crop.shape[1]]
        assert np.abs(crop.astype(int) - saved).max() <= 2


def test_error_maps_share_one_scale_and_tell_their_values(room: Opened, pages: dict[str, Path]) -> None:
    figure = room.tab.locator('.maps[data-kind="inscattered"]')
    assert figure.locator(".ramp").count() == 1
    names = figure.locator("figcaption > span").all_inner_texts()
    assert names == [*LABELS, "the truth’s own standard error"]
    # In the beam every technique lacks a part (1 − factor) of its light: the map must say so, whatever its colour.
    first = figure.locator("img").first
    first.scroll_into_view_if_needed()
    box = first.bounding_box()
    room.tab.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    room.settle()
    found = figure.locator("output").all_inner_texts()
    lights = json.loads((pages["room"].parent / "results.json").read_text())
    assert lights["results"][0]["technique"] == "off"
    values = [float(text.replace("\u00a0", " ").split(" ")[-2]) for text in found]
    off = values[0]
    for value, (_, factor, _) in zip(values, TECHNIQUES, strict=False):
        assert value == pytest.approx(off * (1 - factor), rel=0.06)
    assert figure.locator(".cross:visible").count() == len(LABELS) + 1

    first.focus()
    first.press("Shift+ArrowRight")
    room.settle()
    assert figure.locator("output").all_inner_texts() != found, "out of the beam"


def test_the_colours_of_the_bar_are_those_of_the_maps(room: Opened) -> None:
    gradient = room.tab.eval_on_selector('[data-role="ramp"]', "(e) => getComputedStyle(e).backgroundImage")
    first, last = colour_map()[0], colour_map()[255]
    assert f"rgb({first[0]}, {first[1]}, {first[2]})" in gradient
    assert f"rgb({last[0]}, {last[1]}, {last[2]})" in gradient


def test_the_divider_also_divides_error_maps(room: Opened) -> None:
    room.role("frames").uncheck()
    room.tab.locator('input[value="inscattered"]').check(force=True)
    room.settle()
    shown = {tuple(c) for c in room.pixels().reshape(-1, 3).tolist()}
    assert shown <= {tuple(c) for c in colour_map().tolist()} | {(8, 9, 10)}
    assert len(shown) > 1


def test_plots_hold_every_technique(room: Opened) -> None:
    marks = room.tab.locator('[data-role="scatter"] [data-result]')
    assert sorted(marks.evaluate_all("all => all.map((m) => Number(m.dataset.result))")) == list(range(len(TECHNIQUES)))
    assert room.tab.locator('[data-role="scatter"] .point').count() == len(TECHNIQUES) - 1, "off is a line"
    assert room.tab.locator('[data-role="scatter"] .front').count() == 1
    for role in ("passes", "memory"):
        rows = room.tab.locator(f'.plot[data-role="{role}"] g[data-result]')
        assert rows.count() == len(TECHNIQUES)
    parts = room.tab.locator('.plot[data-role="passes"] .part')
    assert parts.count() == 2 * len(TECHNIQUES)
    room.role("passes-all").check()
    room.settle()
    assert parts.count() == 3 * len(TECHNIQUES), "and lighting"
    widths = parts.evaluate_all(
        "all => all.map((p) => [p.getAttribute('aria-label'), Number(p.getAttribute('width'))])"
    )
    slow = {text.split(": ")[1].split(",")[0]: width for text, width in widths if text.startswith("slow")}
    assert slow["scatter"] / slow["apply"] == pytest.approx(7 / 3, rel=0.02)


def test_every_error_and_cost_can_be_plotted(room: Opened) -> None:
    for role in ("kind", "cost", "metric"):
        choices = room.role(role).locator("option").evaluate_all("all => all.map((o) => o.value)")
        assert len(choices) > 1
        for choice in choices:
            room.role(role).select_option(choice)
            room.settle()
            assert room.tab.locator('[data-role="scatter"] [data-result]').count() >= 3, choice
            places = room.tab.locator('[data-role="scatter"] text').evaluate_all("all => all.map((t) => t.outerHTML)")
            assert not any("NaN" in place for place in places)
    assert room.said == []


def test_a_point_opens_its_picture(room: Opened) -> None:
    room.tab.locator('[data-role="scatter"] .point', has_text="slow").press("Enter")
    room.settle()
    assert (room.text("name-left"), room.text("name-right")) == ("slow", "truth")


def test_the_table_sorts(room: Opened) -> None:
    names = room.tab.locator(".sortable tbody th")
    head = room.tab.locator('.sortable thead button[aria-label="volumetric GPU ms, median: sort"]')
    head.click()
    assert names.all_inner_texts() == ["off", "coarse", "fine", "slow"]
    head.click()
    assert names.all_inner_texts() == ["slow", "fine", "coarse", "off"]
    assert head.locator("..").get_attribute("aria-sort") == "descending"


def test_everything_has_a_name(browser: Any, pages: dict[str, Path]) -> None:
    for path in pages.values():
        opened = Opened(browser, path)
        assert opened.tab.evaluate(UNNAMED) == []
        opened.close()


def test_the_keyboard_reaches_every_control_and_the_focus_is_seen(room: Opened) -> None:
    reached = set()
    for _ in range(90):
        room.tab.keyboard.press("Tab")
        role, outline = room.tab.evaluate(
            "() => [document.activeElement.dataset.role, getComputedStyle(document.activeElement).outlineStyle"
            " + getComputedStyle(document.activeElement.firstElementChild ?? document.activeElement).outlineStyle"
            " + getComputedStyle(document.activeElement.nextElementSibling ?? document.activeElement).outlineStyle]"
        )
        if role:
            reached.add(role)
            assert outline.replace("none", ""), role
    assert {"left", "swap", "right", "show", "exposure", "tone", "in", "out", "fit", "stage", "divider"} <= reached


@pytest.mark.parametrize("name", ["room", "several", "old", "sweep"])
def test_a_phone_shows_it_without_scrolling_sideways(browser: Any, pages: dict[str, Path], name: str) -> None:
    opened = Opened(browser, pages[name], viewport={"width": 360, "height": 740}, has_touch=True, is_mobile=True)
    assert opened.tab.evaluate("[document.documentElement.scrollWidth, innerWidth]") == [360, 360]
    if name != "sweep":
        assert opened.role("stage").bounding_box()["width"] <= 360
    assert opened.said == []
    opened.close()


def test_dark_and_light_differ_by_system_and_by_button(browser: Any, pages: dict[str, Path]) -> None:
    def paper(opened: Opened) -> str:
        return str(opened.tab.evaluate("getComputedStyle(document.body).backgroundColor"))

    light, dark = (Opened(browser, pages["room"], color_scheme=scheme) for scheme in ("light", "dark"))
    assert paper(light) != paper(dark)
    button = dark.tab.locator("#theme")
    button.click()
    assert paper(dark) == paper(light)
    assert button.inner_text() == "Theme: light"
    button.click()
    assert paper(dark) != paper(light)
    light.close()
    dark.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_the_contrast_that_it_needs(browser: Any, pages: dict[str, Path], scheme: str) -> None:
    """WCAG 2.2, AA: 4.5 : 1 for text, 3 : 1 for what marks a technique."""
    opened = Opened(browser, pages["room"], color_scheme=scheme)
    colours = opened.tab.evaluate(COLOURS)
    light = {}
    for name, text in colours.items():
        x = np.array([float(v) for v in text[text.index("(") + 1 : -1].split(",")[:3]]) / 255
        light[name] = float(np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722])

    def contrast(a: str, b: str) -> float:
        high, low = sorted((light[a], light[b]), reverse=True)
        return (high + 0.05) / (low + 0.05)

    for ground in ("paper", "sheet", "mark"):
        assert contrast("ink", ground) >= 4.5
        assert contrast("quiet", ground) >= 4.5
    assert contrast("accent", "paper") >= 4.5
    assert all(contrast(f"k{i}", "paper") >= 3 for i in range(8))
    assert contrast("edge", "sheet") >= 3
    opened.close()


def test_tables_fit_on_paper(room: Opened) -> None:
    room.tab.emulate_media(media="print")
    room.tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    widths = room.tab.eval_on_selector_all(".scroll table", "all => all.map((t) => t.getBoundingClientRect().width)")
    assert max(widths) <= 681
    assert room.tab.locator(".bar, .tools").filter(visible=True).count() == 0
    room.tab.evaluate("dispatchEvent(new Event('afterprint'))")
    assert room.tab.eval_on_selector(".sortable", "(table) => table.style.zoom") == ""


def test_motion_is_for_those_who_want_it(browser: Any, pages: dict[str, Path]) -> None:
    still = Opened(browser, pages["room"], reduced_motion="reduce")
    assert still.tab.evaluate("getComputedStyle(document.documentElement).scrollBehavior") == "auto"
    still.close()


def test_without_javascript_there_are_pictures_tables_and_no_dead_controls(
    browser: Any, pages: dict[str, Path]
) -> None:
    opened = browser.new_page(java_script_enabled=False)
    opened.goto(pages["room"].as_uri())
    assert opened.locator("img:visible").count() >= 2 * len(TECHNIQUES) + 1
    assert opened.locator("table.sortable:visible").count() == 1
    assert opened.locator(".tools:visible, .stage:visible, .plot:visible").count() == 0
    opened.close()


def test_of_several_comparisons_one_is_shown(browser: Any, pages: dict[str, Path]) -> None:
    opened = Opened(browser, pages["several"])
    shown = opened.tab.locator("article:visible h2:first-of-type").first
    assert shown.inner_text() == "room a"
    opened.tab.locator("#which").select_option("c1")
    opened.settle()
    assert opened.tab.locator("article:visible").count() == 1
    assert shown.inner_text() == "room b"
    opened.tab.locator(".overview a").first.click()
    opened.tab.wait_for_timeout(100)
    assert shown.inner_text() == "room a"
    assert opened.said == []
    opened.close()


def test_old_results_are_shown_in_8_bits(browser: Any, pages: dict[str, Path]) -> None:
    opened = Opened(browser, pages["old"])
    opened.role("frames").uncheck()
    opened.role("divider").press("Home")
    opened.settle()
    with Image.open(pages["old"].parent / "reference.png") as image:
        assert np.abs(at_stage(opened.pixels()).astype(int) - np.asarray(image)).max() == 0
    assert opened.tab.locator('[data-role="exposure"]').count() == 0
    opened.close()


def test_the_command_can_be_copied(browser: Any, pages: dict[str, Path]) -> None:
    opened = Opened(browser, pages["room"])
    opened.tab.locator(".copy").click()
    opened.tab.wait_for_timeout(200)
    assert opened.tab.locator(".copy").inner_text() in ("Copied", "Selected")
    command = "tyndall compare 'a & b.glb' --truth traced --report"
    if opened.tab.locator(".copy").inner_text() == "Selected":
        assert opened.tab.evaluate("getSelection().toString()").strip() == command
    assert opened.said == []
    opened.close()


def test_a_sweep_is_plotted_against_what_varies(browser: Any, pages: dict[str, Path]) -> None:
    opened = Opened(browser, pages["sweep"])
    plots = opened.tab.locator(".explorer")
    assert plots.count() == 3
    first = plots.first
    assert first.locator("svg[role=img]").count() == 2, "one for each scene"
    assert first.locator(".dot").count() == 12
    named = first.locator('[data-role="legend"] > span').all_inner_texts()
    assert [name.strip() for name in named] == ["froxel", "march"]
    # Twice the lights take twice the time here: equal steps upwards on a logarithmic axis for 1, 2, and three for 8.
    heights = [
        float(first.locator(f'.dot[data-row="{row}"]').evaluate("(dot) => dot.getBBox().y + dot.getBBox().height / 2"))
        for row in range(3)
    ]
    assert (heights[0] - heights[2]) / (heights[0] - heights[1]) == pytest.approx(3, rel=0.02)
    first.locator('[data-role="facet"]').select_option("")
    first.locator('[data-role="x"]').select_option("GPU time of the technique")
    opened.settle()
    assert first.locator("svg[role=img]").count() == 1
    assert first.locator(".front").count() == 6, "a front for each scene and number of lights"
    first.locator('[data-role="filters"] select').last.select_option(label="8")
    opened.settle()
    assert first.locator(".dot").count() == 4
    opened.tab.locator('.sortable thead button[aria-label^="GPU time of the technique"]').click()
    assert opened.tab.locator(".sortable tbody tr").count() == 12
    assert opened.said == []
    opened.close()


def test_two_fingers_zoom_and_one_moves(browser: Any, pages: dict[str, Path]) -> None:
    opened = Opened(browser, pages["room"], viewport={"width": 400, "height": 800}, has_touch=True, is_mobile=True)
    left, top, width, height = opened.stage()
    touch = opened.tab.context.new_cdp_session(opened.tab)

    def fingers(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": left + x * width, "y": top + y * height, "id": i} for i, (x, y) in enumerate(places)]
        touch.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})
        opened.settle()

    assert opened.tab.evaluate("getComputedStyle(document.querySelector('.stage')).touchAction") == "pan-y"
    before = float(opened.text("zoom").rstrip(" %"))
    fingers("Start", (0.2, 0.5), (0.4, 0.5))
    fingers("Move", (0.15, 0.5), (0.5, 0.5))
    fingers("Move", (0.1, 0.5), (0.7, 0.5))
    fingers("End")
    after = float(opened.text("zoom").rstrip(" %"))
    assert after / before == pytest.approx(3, rel=0.1)
    assert opened.tab.evaluate("getComputedStyle(document.querySelector('.stage')).touchAction") == "none"

    opened.role("frames").uncheck()
    opened.stage()
    picture = opened.pixels()
    fingers("Start", (0.8, 0.3))
    fingers("Move", (0.75, 0.3))
    fingers("Move", (0.6, 0.3))
    fingers("End")
    assert (opened.pixels() != picture).any()
    assert opened.role("divider").get_attribute("aria-valuenow") == "50"
    assert opened.tab.locator(".place").count() == 3, "a drag takes no close-up"
    assert opened.said == []
    opened.close()
