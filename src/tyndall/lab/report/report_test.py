"""The page as a file: complete, closed, and safe; and one line for each folder that is none."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from report_samples import SCENE, SIZE, TECHNIQUES, save_comparison, save_old_comparison

from tyndall.app.cli import main
from tyndall.lab.picture import OutputError
from tyndall.lab.report import write_report
from tyndall.lab.report.images import images
from tyndall.lab.report.markup import data, tag
from tyndall.lab.report.results import read
from tyndall.lab.report.verdict import BY_KEY, significant


class Page(HTMLParser):
    """What a browser sees of a page's source."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: Counter[str] = Counter()
        self.attributes: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(text)

    def handle_starttag(self, name: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags[name] += 1
        self.attributes.append((name, dict(attributes)))
        self._open.append(name)
        self.texts.setdefault(name, []).append("")

    def handle_endtag(self, name: str) -> None:
        while self._open and self._open.pop() != name:
            pass

    def handle_data(self, text: str) -> None:
        if self._open:
            self.texts[self._open[-1]][-1] += text


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report") / "room"
    save_comparison(folder)
    write_report(folder)
    return folder


@pytest.fixture(scope="module")
def text(saved: Path) -> str:
    return (saved / "report.html").read_text(encoding="utf-8")


def test_the_page_holds_everything_itself(text: str) -> None:
    page = Page(text)
    for _, attributes in page.attributes:
        for key in ("src", "href", "srcset", "poster", "action", "data"):
            value = attributes.get(key)
            assert value is None or value.startswith(("data:", "#")), value
    assert not re.search(
        r"url\((?!#)|@import|\bfetch\(|XMLHttpRequest|\bimport\s*\(", re.sub(r"base64,[^\"]*", "", text)
    )
    policies = [a["content"] for name, a in page.attributes if name == "meta" and a.get("http-equiv")]
    assert policies
    assert policies[0] is not None
    assert policies[0].startswith("default-src 'none'; img-src data: blob:;")


def test_names_from_files_stay_text(text: str, tmp_path: Path) -> None:
    page = Page(text)
    assert page.texts["h1"] == [SCENE]
    assert f"{SCENE} – Tyndall" in page.texts["title"]
    save_comparison(tmp_path / "plain", "plain")
    other = Page(write_report(tmp_path / "plain").read_text(encoding="utf-8"))
    assert page.tags == other.tags, "a name adds no element"


def test_text_without_scripts_tells_the_figures(saved: Path, text: str) -> None:
    document = json.loads((saved / "results.json").read_text())
    words = re.sub(r"<(script|style)\b.*?</\1>", "", text, flags=re.DOTALL)
    words = re.sub(r"<[^>]+>", "|", words).replace("\u00a0", " ")
    error = document["results"][1]["errors"]["inscattered"]["rel_rmse"]
    assert f"On the Pareto front: coarse (0.100 ms, {100 * error:.0f} % error) and fine (0.400 ms, " in words
    for needed in (
        "4,968",
        "traced",
        "512",
        "tyndall compare 'a &amp; b.glb'",
        "0123456789abcdef",
        "0.32.0",
        "a driver",
    ):
        assert needed in words
    for label, _, _ in TECHNIQUES:
        assert f"|{label}|" in words
    for result in document["results"]:
        for key, value in result["errors"]["inscattered"].items():
            if key in BY_KEY and value is not None:
                text = significant(value * (100 if BY_KEY[key].unit == "%" else 1), 3)
                assert f"|{text}|" in words, (result["label"], key)


def test_every_picture_has_words_and_every_control_a_name(text: str) -> None:
    page = Page(text)
    pictures = [a for name, a in page.attributes if name == "img"]
    assert len(pictures) > 3 * len(TECHNIQUES)
    assert all(a.get("alt") for a in pictures)
    ids = [a["id"] for _, a in page.attributes if a.get("id")]
    assert len(ids) == len(set(ids))


def test_plots_have_the_data_of_the_results(saved: Path, text: str) -> None:
    found = re.search(r'<script type="application/json" class="data">(.*?)</script>', text, re.DOTALL)
    assert found
    plain, document = json.loads(found[1]), json.loads((saved / "results.json").read_text())
    assert plain["scene"] == SCENE
    for row, result in zip(plain["results"], document["results"], strict=True):
        assert row["gpu"] == result["gpu_ms"]
        assert row["errors"]["inscattered"]["rel_rmse"] == result["errors"]["inscattered"]["rel_rmse"]
        assert dict(row["passes"]) == {k: v for k, v in result["passes"].items() if k != "frame"}
        assert dict(row["owners"]) == result["memory"]
    assert set(plain["maps"]) == {"inscattered", "radiance"}
    assert plain["maps"]["inscattered"]["labels"] == [*(label for label, _, _ in TECHNIQUES), "truth"]


def test_places_are_where_the_error_is(saved: Path) -> None:
    made = images(read(saved))
    x, y, w, h = (getattr(made.crops[0][0], name) for name in ("x", "y", "width", "height"))
    middle = (x + w / 2) / SIZE[0] - 0.4 * (y + h / 2) / SIZE[1]
    assert abs(middle - 0.3) < 0.12, "in the beam"
    assert made.keys[made.opening[0]] == "coarse"
    assert made.keys[made.opening[1]] == "truth"


def test_a_page_that_would_be_heavy_has_smaller_pictures(tmp_path: Path) -> None:
    save_comparison(tmp_path / "room", size=(256, 144))
    study = read(tmp_path / "room")
    whole = images(study)
    assert (whole.size, whole.notes) == ((256, 144), [])
    smaller = images(study, most_bytes=sum(map(len, [*whole.light, *whole.uris])))
    factor = 256 // smaller.size[0]
    assert smaller.size == (256 // factor, 144 // factor)
    assert factor > 1
    assert f"1/{factor} of their size" in smaller.notes[0]
    assert sum(map(len, smaller.light)) < sum(map(len, whole.light)) / 2
    for place, _ in smaller.crops:
        assert place.x + place.width <= smaller.size[0]
        assert place.y + place.height <= smaller.size[1]


def test_results_of_an_older_version_are_shown_as_far_as_they_go(tmp_path: Path) -> None:
    save_old_comparison(tmp_path / "old")
    text = write_report(tmp_path / "old").read_text(encoding="utf-8")
    assert "8 bits" in text
    assert 'data-kind="radiance"' in text, "maps of the saved pictures"
    assert "The command was not recorded." in text
    study = read(tmp_path / "old")
    assert [r.label for r in study.results] == [label for label, _, _ in TECHNIQUES]
    assert study.kinds == ["inscattered"]


def test_without_a_truth_there_are_no_errors_but_a_page(tmp_path: Path) -> None:
    document = save_comparison(tmp_path / "a")
    document["reference"] = None
    for result in document["results"]:
        result["errors"], result["error"] = {}, None
    (tmp_path / "a/results.json").write_text(json.dumps(document))
    text = write_report(tmp_path / "a").read_text(encoding="utf-8")
    assert "coarse is the fastest" in text
    assert "no truth here" in text


def test_several_comparisons_are_one_page(tmp_path: Path) -> None:
    for name in ("b", "a"):
        save_comparison(tmp_path / name, f"room {name}")
    page = Page(write_report(tmp_path).read_text(encoding="utf-8"))
    assert page.tags["article"] == 2
    assert page.texts["h1"] == ["2 comparisons"]
    assert [t for t in page.texts["h2"] if t.startswith("room")] == ["room a", "room b"]


def put(**changes: Any) -> Callable[[Path], object]:
    """A mistake: other values in results.json; those named ``results__x`` in its first result."""

    def apply(folder: Path) -> None:
        document = json.loads((folder / "results.json").read_text())
        for key, value in changes.items():
            target = document["results"][0] if key.startswith("results__") else document
            target[key.removeprefix("results__")] = value
        (folder / "results.json").write_text(json.dumps(document))

    return apply


def write(content: str) -> Callable[[Path], object]:
    return lambda folder: (folder / "results.json").write_text(content)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda folder: (folder / "results.json").unlink(), r"room: has no results\.json"),
        (write("{"), r"results\.json: is no JSON"),
        (write("[" * 100_000), r"results\.json: is no JSON"),
        (write("[]"), r"results\.json: is no object"),
        (write("{}"), r"results\.json: scene: field required"),
        (put(results=[]), r"results\.json: results: list should have at least 1 item"),
        (put(results=7), r"results\.json: results: "),
        (put(size=[0, 5]), r"results\.json: size\[0\]: "),
        (put(results__gpu_ms={"median": "x"}), r"results\.json: results\[0\]\.gpu_ms\.median: "),
        (put(results__image="../../secret.png"), r"is not inside the folder"),
        (put(size=[5, 5]), r"is 96×54, and results\.json says 5×5"),
        (lambda folder: (folder / "fine.png").unlink(), r"fine\.png: is missing"),
        (lambda folder: (folder / "fine.exr").write_bytes(b"no"), r"fine\.exr: is no EXR"),
        (lambda folder: (folder / "fine-still.exr").unlink(), r"fine-still\.exr: is missing"),
        (lambda folder: (folder / "report.html").mkdir(), r"report\.html: is a folder"),
    ],
)
def test_what_is_no_result_is_one_line(
    tmp_path: Path, spoil: Callable[[Path], object], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "room"
    save_comparison(folder)
    before = set(folder.iterdir())
    spoil(folder)
    with pytest.raises(OutputError, match=says):
        write_report(folder)
    assert {p.name for p in folder.iterdir()} <= {p.name for p in before} | {"report.html"}, "nothing is left behind"
    assert main(["report", str(folder)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_folder_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is no folder"):
        write_report(tmp_path / "none")


def test_the_command_says_where_the_page_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_comparison(tmp_path / "room")
    assert main(["report", str(tmp_path / "room"), "--json"]) == 0
    page = Path(json.loads(capsys.readouterr().out)["report"])
    assert page == tmp_path / "room/report.html"
    assert page.stat().st_size < 600_000


def test_no_asset_ends_the_element_that_it_stands_in() -> None:
    folder = Path(write_report.__code__.co_filename).parent
    assets = [*folder.glob("*.js"), *folder.glob("*.css")]
    assert len(assets) > 5
    for asset in assets:
        assert not re.search("</(script|style)", asset.read_text(encoding="utf-8"), re.IGNORECASE), asset.name


def test_markup_escapes_text_and_data() -> None:
    assert tag("p", "<b>", title='"&') == '<p title="&quot;&amp;">&lt;b&gt;</p>'
    block = data({"name": "</script><!--"})
    assert "<" not in block[len("<script") : -len("</script>")]
    assert json.loads(block[block.index(">") + 1 : block.rindex("<")]) == {"name": "</script><!--"}
