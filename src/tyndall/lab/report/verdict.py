"""What the figures of a comparison say, in sentences made from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tyndall.lab.report.results import Result, Study

BASELINE = "off"  # draws nothing: its error is the light that there is, and it is no candidate


@dataclass(frozen=True)
class Metric:
    """How to show a figure of :mod:`tyndall.lab.metrics`.

    Attributes:
        unit: "%" for a fraction that is shown as one, "dB", "×", or nothing.
        better: "less", "more", "zero" or "one": where a perfect picture lies.
        meaning: a line for the glossary.
    """

    key: str
    name: str
    unit: str
    better: str
    meaning: str


METRICS = (
    Metric(
        "rel_rmse_corrected",
        "rel. RMSE, corrected",
        "%",
        "less",
        "Root mean square error over the truth’s mean, after the truth’s own variance is taken off: an unbiased "
        "estimate of the technique’s own error. “<” is what it may be at most, by three standard errors, where the "
        "truth’s noise hides it.",
    ),
    Metric(
        "rel_rmse",
        "relative RMSE",
        "%",
        "less",
        "Root mean square error over the truth’s mean. No light at all scores 100 % or more. It still holds the "
        "truth’s own noise.",
    ),
    Metric(
        "boundary",
        "error at shadow edges",
        "%",
        "less",
        "Relative RMSE over the pixels near an edge of a shadow, where techniques differ most.",
    ),
    Metric(
        "bias",
        "bias",
        "%",
        "zero",
        "Mean signed error over the truth’s mean: −100 % means that all light is missing. Noise alone has none.",
    ),
    Metric(
        "relmse",
        "relMSE",
        "",
        "less",
        "Mean of squared errors, each pixel relative to its own square: dark parts count as much as bright ones.",
    ),
    Metric("rmse", "RMSE", "", "less", "Root mean square error in the unit of the light (radiance)."),
    Metric(
        "psnr",
        "PSNR",
        "dB",
        "more",
        "Peak signal-to-noise ratio, 20·log₁₀(peak / RMSE). 6 dB more is half the error.",
    ),
    Metric(
        "ssim",
        "SSIM",
        "",
        "one",
        "Structural similarity (Wang et al. 2004): agreement of local means, contrasts and patterns; 1 is equal.",
    ),
    Metric(
        "flip",
        "FLIP",
        "",
        "less",
        "HDR-FLIP (Andersson et al. 2021): the difference that a person notices when flipping between the pictures, "
        "from 0 to 1.",
    ),
    Metric(
        "scaled_rel_rmse",
        "rel. RMSE at best scale",
        "%",
        "less",
        "Relative RMSE after the one factor that fits best: the light’s shape apart from its strength, for techniques "
        "that are only right up to a scale.",
    ),
    Metric("best_scale", "best scale", "×", "one", "That factor: 1 where the light’s strength is right."),
)
BY_KEY = {metric.key: metric for metric in METRICS}
KINDS = {"inscattered": "light in the air", "surfaces": "light of surfaces", "radiance": "whole picture"}
KIND_MEANINGS = {
    "inscattered": "Only the light scattered by the air towards the eye (L_v), which is what a volumetric technique "
    "adds: a bright background cannot dilute its error.",
    "surfaces": "Only the light of surfaces that reaches the eye through the air (L_b·T), which is what a shadow "
    "technique changes.",
    "radiance": "All light that reaches the eye: surfaces seen through the air, and the air itself.",
}


def kind_name(kind: str) -> str:
    """What a kind of light is called."""
    return KINDS.get(kind, kind.replace("_", " "))


def front(points: Iterable[tuple[str, float, float]]) -> list[str]:
    """The Pareto front of (label, cost, error): those that no other beats in one without losing in the other, by
    rising cost. Of equal points all are on it.

    >>> front([("a", 1, 5), ("b", 2, 3), ("c", 3, 4)])
    ['a', 'b']
    """
    found: list[tuple[str, float, float]] = []
    for point in sorted(points, key=lambda p: (p[1], p[2])):
        if not found or point[2] < found[-1][2] or point[1:] == found[-1][1:]:
            found.append(point)
    return [label for label, _, _ in found]


def main_metric(study: Study) -> tuple[str, str] | None:
    """The kind of light and the metric that a verdict is made by; None where there are no errors."""
    if not study.kinds:
        return None
    kind = study.kinds[0]
    scores = [result.errors.get(kind, {}) for result in study.results]
    for key in ("rel_rmse_corrected", "rel_rmse"):
        if any(score.get(key) is not None for score in scores):
            return kind, key
    return None


@dataclass(frozen=True)
class Judged:
    """An error as it can be known: where the truth’s noise hides it (``hidden``), ``value`` is what it is at most."""

    value: float
    hidden: bool = False

    @property
    def rank(self) -> float:
        """For comparing techniques: all hidden errors are equal, as nothing tells them apart."""
        return 0.0 if self.hidden else self.value

    def __str__(self) -> str:
        return ("<\u00a0" if self.hidden else "") + percent(self.value)


def judged_error(result: Result, kind: str, key: str) -> Judged | None:
    """An error of a technique; None where it was not measured."""
    return judged(result.errors.get(kind, {}), key)


def judged(scores: Mapping[str, Any], key: str) -> Judged | None:
    """One of the figures of :mod:`tyndall.lab.metrics`; None where it does not exist."""
    value, limit = scores.get(key), scores.get("rel_rmse_limit")
    if value is None:
        return None
    if key == "rel_rmse_corrected" and scores.get("within_noise") and limit is not None:
        return Judged(limit, hidden=True)
    return Judged(value)


def best(study: Study) -> list[str]:
    """The labels on the Pareto front of GPU time and error."""
    main = main_metric(study)
    if main is None:
        return []
    errors = {r.label: judged_error(r, *main) for r in study.results if r.technique != BASELINE}
    times = {r.label: r.gpu_ms.median for r in study.results if r.gpu_ms}
    return front((label, times[label], e.rank) for label, e in errors.items() if e and label in times)


def verdict(study: Study) -> str:
    """One sentence: who is on the Pareto front of time and error, with the figures."""
    main = main_metric(study)
    candidates = [r for r in study.results if r.technique != BASELINE]
    timed = {r.label: r.gpu_ms.median for r in candidates if r.gpu_ms}
    if main is None:
        if not timed:
            return "Neither errors nor times: no truth was asked for, and this adapter cannot time what it draws."
        label = min(timed, key=timed.__getitem__)
        return f"{label} is the fastest ({milliseconds(timed[label])}). No truth was asked for, so there are no errors."
    errors = {r.label: e for r in candidates if (e := judged_error(r, *main))}
    if not errors:
        return "No technique’s error could be measured."
    if not timed:
        label = min(errors, key=lambda name: errors[name].rank)
        return f"{label} is the most accurate ({errors[label]} error). This adapter cannot time what it draws."
    figures = {label: f"{milliseconds(timed[label])}, {errors[label]} error" for label in errors if label in timed}
    names = best(study)
    if len(figures) == 1:
        return f"{names[0]}: {figures[names[0]]}."
    if len(names) == 1:
        tied = any(errors[label].rank == errors[names[0]].rank for label in figures if label not in names)
        accuracy = "no technique is known to be more accurate than it" if tied else "the most accurate"
        return f"{names[0]} is the fastest of {len(figures)} techniques, and {accuracy}: {figures[names[0]]}."
    return f"On the Pareto front: {listed([f'{label} ({figures[label]})' for label in names])}."


def remarks(study: Study) -> list[str]:
    """What else the figures say: who loses to whom, what the truth’s noise hides, and what a factor would mend."""
    main = main_metric(study)
    if main is None:
        return []
    kind, key = main
    errors = {r.label: e for r in study.results if (e := judged_error(r, kind, key))}
    candidates = {r.label: r.gpu_ms.median for r in study.results if r.gpu_ms and r.technique != BASELINE}
    names, text = best(study), []
    losers: dict[tuple[str, bool], list[str]] = {}
    for label in candidates:
        if label in names or label not in errors:
            continue
        better = [n for n in names if candidates[n] <= candidates[label] and errors[n].rank <= errors[label].rank]
        winner = min(better, key=lambda n: errors[n].rank)
        losers.setdefault((winner, errors[winner].rank == errors[label].rank), []).append(label)
    for (winner, tied), beaten in losers.items():
        if len(names) == 1 and not tied:
            continue  # the verdict has said so
        what = "faster than" if tied else "both faster and more accurate than"
        text.append(f"{winner} is {what} {listed(beaten)}{', at an error that cannot be told apart' if tied else ''}.")
    nothing = next((errors[r.label] for r in study.results if r.technique == BASELINE and r.label in errors), None)
    worse = [label for label, error in errors.items() if nothing and error.rank > nothing.value]
    if worse:
        text.append(f"No light at all would be nearer to the truth ({nothing}) than {listed(worse)}.")
    scaled = []
    for result in study.results:
        scores = result.errors.get(kind, {})
        left, factor = scores.get("scaled_rel_rmse"), scores.get("best_scale")
        if result.up_to_scale and left is not None and factor is not None:
            scaled.append(f"{result.label} (times {significant(factor, 2)} it is {percent(left)} off)")
    if scaled:
        text.append(f"Right up to a factor only: {listed(scaled)}.")
    if any(result.model == "paper" for result in study.results):
        text.append("What ends in -paper has its paper’s own units, and is held against the same physical truth.")
    noise = study.reference.relative_error.get(kind) if study.reference else None
    if noise:
        hidden = [label for label, error in errors.items() if error.hidden]
        end = f", which hides the error of {listed(hidden)}" if hidden else ""
        text.append(f"The truth’s own standard error is {percent(noise)}{end}.")
    return text


def listed(names: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def milliseconds(ms: float) -> str:
    """Three significant digits, which is what a timer gives."""
    return f"{significant(ms, 3)}\u00a0ms"


def percent(fraction: float, digits: int | None = None) -> str:
    """A fraction as a percentage of so many digits; by itself of three from 100 % on, else of two."""
    return f"{significant(100 * fraction, digits or (3 if abs(fraction) >= 1 else 2))}\u00a0%"


def significant(value: float, digits: int) -> str:
    """Rounded to so many digits, without an exponent, with a true minus sign."""
    if value == 0:
        return "0"
    text = f"{float(f'{value:.{digits}g}'):.12f}"
    whole = text.lstrip("-").split(".")[0]
    decimals = max(0, digits - len(whole)) if whole != "0" else _decimals(value, digits)
    return f"{float(f'{value:.{digits}g}'):.{decimals}f}".replace("-", "−")


def _decimals(value: float, digits: int) -> int:
    """How many places after the point show so many digits of a value below 1; twelve at most."""
    exponent = int(f"{value:e}".split("e")[1])
    return min(12, digits - 1 - exponent)
