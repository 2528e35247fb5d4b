"""What a comparison found: a table, plain data, a folder of pictures, a report."""

from __future__ import annotations

import base64
import json
import math
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyndall.lab import metrics
from tyndall.lab.closeup import strip
from tyndall.lab.fingerprint import versions
from tyndall.lab.measure import Measurement
from tyndall.lab.metrics import Scores
from tyndall.lab.picture import OutputError, Picture, check_folder, encode_png, write_layers
from tyndall.lab.stage import Still
from tyndall.lab.standard import KINDS, LAYERS, SYMBOLS, Standard
from tyndall.techniques import FAMILIES

if TYPE_CHECKING:
    from rich.table import Table

_NOISY = 0.01  # the truth's relative standard error from which on its noise is seen by every metric


@dataclass(frozen=True)
class Error:
    """How far a technique is from the truth, in short: see :mod:`tyndall.lab.metrics`.

    ``psnr`` is that of the two final 8-bit pictures, in dB; infinite if they are equal.
    """

    rel_rmse: float
    bias: float
    psnr: float

    def to_json(self) -> dict[str, float | None]:
        """JSON has no infinity: the PSNR of equal pictures is null."""
        return {
            "rel_rmse": round(self.rel_rmse, 6),
            "psnr": round(self.psnr, 3) if math.isfinite(self.psnr) else None,
            "bias": round(self.bias, 6),
        }


@dataclass(frozen=True, eq=False)
class Result:
    """One technique's part of a comparison.

    Attributes:
        label: unique in a comparison, and the name of its files: the technique, "-paper" where its model is the
            paper's, and a number where several would be called the same.
        family: the family that is compared.
        technique: its name.
        model: "physical" or "paper"; None for a technique that has one model only.
        up_to_scale: whether its light is right only up to a factor.
        parameters: all of its parameters.
        measurement: times and bytes.
        scores: all errors, by kind of light; empty without a truth, or where they could not be measured.
        psnr: of the final 8-bit pictures in dB; None without a truth.
        picture: the last antialiased frame.
        still: the frame that errors were measured on.
    """

    label: str
    family: str
    technique: str
    model: str | None
    up_to_scale: bool
    parameters: Mapping[str, Any]
    measurement: Measurement
    scores: Mapping[str, Scores]
    psnr: float | None
    picture: Picture
    still: Still

    @property
    def memory_bytes(self) -> int:
        """Bytes that the technique itself holds on the device, the tree included where it casts rays."""
        tree = FAMILIES[self.family].members[self.technique].casts_rays
        return self.measurement.bytes_of(self.family) + (self.measurement.bytes_of("tracing") if tree else 0)

    @property
    def main(self) -> Scores | None:
        """Errors of the light that the comparison is about: ``L_v`` for volumetric techniques."""
        return self.scores.get(KINDS[self.family][0])

    @property
    def error(self) -> Error | None:
        """The main errors in short; None without a truth, or where it holds no light."""
        main = self.main
        if main is None or main.rel_rmse is None or main.bias is None or self.psnr is None:
            return None
        return Error(main.rel_rmse, main.bias, self.psnr)

    def to_json(self, place: Callable[[str], str | None]) -> dict[str, Any]:
        """The entry of ``results``; ``place`` says where a file was saved. Times are null without a GPU timer."""
        measured, frame = self.measurement, self.measurement.frame
        technique = measured.technique(self.family)
        return {
            "label": self.label,
            "technique": self.technique,
            "model": self.model,
            "up_to_scale": self.up_to_scale,
            "gpu_ms": technique.to_json() if technique else None,
            "frame_ms": round(frame.median, 6) if frame else None,
            "host_ms": round(measured.host.median, 6),
            "passes": {name: round(times.median, 6) for name, times in measured.passes.items()},
            "memory_bytes": self.memory_bytes,
            "memory": dict(measured.memory),
            "error": self.error.to_json() if self.error else None,
            "errors": {kind: scores.to_json() for kind, scores in self.scores.items()},
            "image": place(f"{self.label}.png"),
            "exr": place(f"{self.label}.exr"),
            "still_exr": place(f"{self.label}-still.exr"),
        }

    def save(self, folder: Path) -> None:
        """Write its picture, its light, and the light of the still frame with ``L_v`` as a layer."""
        self.picture.save(folder / f"{self.label}.png")
        self.picture.save(folder / f"{self.label}.exr")
        layers = {LAYERS[kind]: self.still.of(kind) for kind in LAYERS}
        still = self.still.picture
        write_layers(folder / f"{self.label}-still.exr", layers, still.depth, still.metadata)


@dataclass(eq=False)
class Comparison:
    """The same view by several techniques: see :func:`tyndall.lab.compare.compare`.

    Attributes:
        scene: name of the scene.
        family: whose techniques were compared.
        exposure: the camera's, in EV.
        results: in the order asked for.
        reference: what errors are against; None where no truth was asked for.
        skipped: why a technique that was not asked for by name took no part, by name.
        missing: why errors of a technique are missing, by label.
        command: the one command that does it again; None where it was not begun by one.
        folder: where it was saved last, or None.
    """

    scene: str
    scene_hash: str
    triangles: int
    size: tuple[int, int]
    exposure: float
    family: str
    adapter: str
    driver: str
    parameters: Mapping[str, Any]
    results: list[Result]
    reference: Standard | None
    skipped: Mapping[str, str] = field(default_factory=dict)
    missing: Mapping[str, str] = field(default_factory=dict)
    command: str | None = None
    folder: Path | None = None

    def __getitem__(self, label: str) -> Result:
        """A result by its label: ``comparison["froxel"]``, ``comparison["froxel-paper"]``."""
        for result in self.results:
            if result.label == label:
                return result
        raise KeyError(label)

    def table(self) -> Table:
        """For a terminal of 80 columns or a notebook, by rich.

        A technique that is right only up to a scale has a second line: the best-fitting factor, and the error that is
        left with it. ``<`` marks an error that is hidden in the truth's noise, and is less than what stands there.
        """
        from rich import box
        from rich.table import Table
        from rich.text import Text

        width, height = self.size
        title = f"{self.scene} · {self.triangles:,} triangles · {width}×{height} · {self.adapter}"
        symbol = SYMBOLS[KINDS[self.family][0]]
        table = Table(
            title=Text(title), caption=Text("\n".join(self._notes())), caption_justify="left", box=box.SIMPLE_HEAD
        )
        table.padding, table.show_edge = 0, False
        table.add_column(self.family, no_wrap=True)
        for heading in ("GPU ms\nmedian", "\nmin", "\np95", "frame\nms", "memory\nMiB"):
            table.add_column(heading, justify="right", no_wrap=True)
        for heading in (f"{symbol} rel\nRMSE %", "at\nedges", "\nbias %", "\nFLIP", "PSNR\ndB"):
            table.add_column(heading, justify="right", no_wrap=True)
        for result in self.results:
            technique, frame = result.measurement.technique(self.family), result.measurement.frame
            times = (technique.median, technique.min, technique.p95) if technique else 3 * (None,)
            table.add_row(
                result.label.replace("-paper", "*"),
                *(_milliseconds(ms) for ms in (*times, frame.median if frame else None)),
                f"{result.memory_bytes / 2**20:.2f}",
                *_figures(result),
            )
            main = result.main
            if main and result.up_to_scale and main.scaled_rel_rmse is not None:
                table.add_row(f"  scaled ×{main.best_scale:.3g}", *5 * [""], _percent(main.scaled_rel_rmse))
        return table

    def __str__(self) -> str:
        from rich.console import Console

        text = StringIO()
        Console(file=text, width=120).print(self.table())
        return text.getvalue().rstrip("\n")

    def _notes(self) -> list[str]:
        notes = []
        if self.reference:
            notes.append(self.reference.caption())
        if any(r.main and r.main.within_noise for r in self.results):
            notes.append("<: less than this is hidden in the truth's noise; more --truth.seconds leave less of it,")
            notes.append("   and --truth march, a march in the same shadow map, has none")
        if self.reference and self.reference.noise["radiance"] > _NOISY:
            notes.append("FLIP, PSNR and errors at edges count the truth's noise as well")
        if any(not result.measurement.passes for result in self.results):
            notes.append("this adapter cannot time what it draws (timestamp-query)")
        if any(result.model == "paper" for result in self.results):
            notes.append("* the paper's own units, held against the same physical truth")
        if any(result.up_to_scale and result.main for result in self.results):
            notes.append("scaled: the error that the best-fitting factor leaves, where light is right up to one only")
        notes += dict.fromkeys(line for r in self.results for s in r.scores.values() for line in s.missing)
        notes += [f"{label}: no errors: {reason}" for label, reason in self.missing.items()]
        notes += [f"{name}: {reason}" for name, reason in self.skipped.items()]
        return notes

    def to_json(self) -> dict[str, Any]:
        """Plain data, ready for ``json.dumps``; ``image`` is a path once :meth:`save` was called, else null."""
        folder = self.folder
        return self._json(lambda name: str(folder / name) if folder else None)

    def _json(self, place: Callable[[str], str | None]) -> dict[str, Any]:
        return {
            "adapter": self.adapter,
            "scene": self.scene,
            "triangles": self.triangles,
            "size": list(self.size),
            "family": self.family,
            "exposure": self.exposure,
            "results": [result.to_json(place) for result in self.results],
            "reference": self.reference.to_json(place("reference.png")) if self.reference else None,
            "versions": versions(),
            "driver": self.driver,
            "parameters": {**self.parameters, self.family: {r.label: dict(r.parameters) for r in self.results}},
            "scene_hash": self.scene_hash,
            "command": self.command,
            **({"skipped": dict(self.skipped)} if self.skipped else {}),
            **({"missing": dict(self.missing)} if self.missing else {}),
        }

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write pictures and light of each technique and of the truth, close-ups of each technique, ``results.json``.

        Of each technique: ``LABEL.png`` and ``LABEL.exr``, antialiased, and ``LABEL-still.exr``, the frame that errors
        are of, with ``L_v`` as the layer ``inscatter`` and ``L_b·T`` as ``surfaces``; the truth's ``reference.exr`` has
        the same layers, and its standard error as ``radiance_error`` and ``inscatter_error``.

        All files are made in a temporary folder beside ``folder`` first and then moved, ``results.json`` last; other
        files in an existing folder stay as they are. Paths in ``results.json`` are relative to it.

        Raises:
            OutputError: ``folder`` is a file, or the system refuses.
        """
        target = Path(folder)
        check_folder(target)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
        except OSError as error:
            raise OutputError(f"{target}: {error.strerror or error}") from error
        try:
            self._write(temporary)
            target.mkdir(exist_ok=True)
            for path in sorted(temporary.iterdir(), key=lambda p: p.name == "results.json"):
                os.replace(path, target / path.name)
        except OSError as error:
            raise OutputError(f"{target}: {error.strerror or error}") from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        self.folder = target
        return target

    def report(self, folder: str | os.PathLike[str]) -> Path:
        """:meth:`save`, then write ``report.html`` there: one page that needs nothing but a browser.

        Returns:
            The page's path.

        Raises:
            OutputError: as :meth:`save`.
        """
        from tyndall.lab.report import write_report

        return write_report(self.save(folder))

    def _write(self, folder: Path) -> None:
        for result in self.results:
            result.save(folder)
        if self.reference:
            self.reference.save(folder)
            for result in self.results:
                (folder / f"{result.label}-closeup.png").write_bytes(encode_png(_closeup(result, self.reference)))
        document = json.dumps(self._json(lambda name: name), indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "results.json").write_text(document + "\n", encoding="utf-8")

    def _repr_html_(self) -> str:
        from rich.console import Console

        console = Console(record=True, file=StringIO(), width=120)
        console.print(self.table())
        table = console.export_html(inline_styles=True, code_format='<pre style="line-height:1.25">{code}</pre>')
        pictures = [(result.label, result.picture) for result in self.results]
        if self.reference:
            pictures.append(("reference", self.reference.picture))
        figures = "".join(
            f'<figure style="display:inline-block;margin:4px"><img width="320" src="data:image/png;base64,'
            f'{base64.b64encode(picture._repr_png_()).decode()}"><figcaption>{label}</figcaption></figure>'
            for label, picture in pictures
        )
        return f"<div>{table}{figures}</div>"


def _closeup(result: Result, standard: Standard) -> Any:
    kind = KINDS[result.family][0]
    error = metrics.error_map(result.still.of(kind), standard.targets[kind].light)
    main, symbol = result.main, SYMBOLS[kind]
    score = f", {symbol} rel. RMSE {_error(main)} %" if main and main.rel_rmse is not None else ""
    names = (f"truth: {standard.truth.judge}", result.label + score, symbol)
    return strip(standard.still, result.still.picture.pixels, error, names)


def _milliseconds(ms: float | None) -> str:
    """Three significant digits, which is what a timer gives; a dash where there is no timer."""
    if ms is None:
        return "–"
    return f"{ms:.3f}" if ms < 1 else f"{ms:.2f}" if ms < 10 else f"{ms:.1f}" if ms < 100 else f"{ms:.0f}"


def _percent(fraction: float | None, sign: str = "") -> str:
    """Of three or four digits; a dash for what does not exist."""
    if fraction is None:
        return "–"
    percent = 100 * fraction
    return f"{percent:{sign}.2f}" if abs(percent) < 100 else f"{percent:{sign}.0f}"


def _error(scores: Scores) -> str:
    """The relative RMSE in percent, the truth's noise taken off, or what that noise might hide."""
    return f"<{_percent(scores.rel_rmse_limit)}" if scores.within_noise else _percent(scores.rel_rmse_corrected)


def _figures(result: Result) -> tuple[str, ...]:
    """The errors of a row."""
    main = result.main
    if main is None:
        return 5 * ("–",)
    whole = result.scores["radiance"].flip
    psnr = "–" if result.psnr is None or main.rel_rmse is None else f"{result.psnr:.1f}"
    return (
        _error(main),
        _percent(main.boundary),
        _percent(main.bias, "+"),
        "–" if whole is None else f"{whole:.3f}",
        psnr,
    )
