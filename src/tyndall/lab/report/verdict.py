"""What the figures of a comparison say, in sentences made from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from tyndall.lab.report.results import Study

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
        "rel. RMSE, truth’s noise off",
        "%",
        "less",
        "Root mean square error over the truth’s mean, after the truth’s own variance is taken off: an unbiased "
        "estimate of the technique’s own error.",
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


def verdict(study: Study) -> str:
    """A sentence or two: who is on the Pareto front of time and error, with the figures, and who is not."""
    judged = main_metric(study)
    candidates = [r for r in study.results if r.technique != BASELINE]
    timed = [(r.label, r.gpu_ms.median) for r in candidates if r.gpu_ms]
    if judged is None:
        if not timed:
            return "Neither errors nor times: no truth was asked for, and this adapter cannot time what it draws."
        label, ms = min(timed, key=lambda pair: pair[1])
        return f"{label} is the fastest ({milliseconds(ms)}). No truth was asked for, so there are no errors."
    kind, key = judged
    errors = {r.label: e for r in candidates if (e := r.errors.get(kind, {}).get(key)) is not None}
    if not errors:
        return "No technique’s error could be measured: the truth holds no light of that kind."
    if not timed:
        label = min(errors, key=errors.__getitem__)
        return f"{label} is the most accurate ({percent(errors[label])} error). This adapter cannot time what it draws."
    points = [(label, ms, errors[label]) for label, ms in timed if label in errors]
    figures = {label: f"{milliseconds(ms)}, {percent(error)} error" for label, ms, error in points}
    best = front(points)
    if len(points) == 1:
        return f"{best[0]}: {figures[best[0]]}." + _warning(study, kind, key, errors)
    if len(best) == 1:
        text = f"{best[0]} is both the fastest and the most accurate of {len(points)} techniques: {figures[best[0]]}."
        return text + _warning(study, kind, key, errors)
    text = f"On the Pareto front: {listed([f'{label} ({figures[label]})' for label in best])}."
    losers: dict[str, list[str]] = {}
    for label, ms, error in points:
        if label not in best:  # then one on the front is at least as good at both; the most accurate one is named
            winner = [name for name, t, e in points if name in best and t <= ms and e <= error]
            losers.setdefault(min(winner, key=errors.__getitem__), []).append(label)
    text += "".join(
        f" {winner} is both faster and more accurate than {listed(names)}." for winner, names in losers.items()
    )
    return text + _warning(study, kind, key, errors)


def _warning(study: Study, kind: str, key: str, errors: Mapping[str, float]) -> str:
    """Which techniques are further from the truth than no light at all, and what a factor would mend."""
    nothing = [
        e for r in study.results if r.technique == BASELINE and (e := r.errors.get(kind, {}).get(key)) is not None
    ]
    worse = [label for label, error in errors.items() if nothing and error > nothing[0]]
    text = (
        f" No light at all would be nearer to the truth ({percent(nothing[0])}) than {listed(worse)}." if worse else ""
    )
    for result in study.results:
        scores = result.errors.get(kind, {})
        left, factor = scores.get("scaled_rel_rmse"), scores.get("best_scale")
        if result.up_to_scale and left is not None and factor is not None:
            times = significant(factor, 2)
            text += f" {result.label} is right up to a factor only: times {times} its error is {percent(left)}."
    return text


def doubt(study: Study) -> str | None:
    """What the truth says of itself: its standard error, and which techniques it cannot tell from right."""
    truth, judged = study.reference, main_metric(study)
    if truth is None or judged is None:
        return None
    kind, _ = judged
    noise = truth.relative_error.get(kind)
    if not noise:
        return None
    text = f"Truth’s own standard error: {percent(noise)}"
    within = [r.label for r in study.results if r.errors.get(kind, {}).get("within_noise")]
    if within:
        text += f"; within it, {listed(within)} cannot be told from right"
    return text + "."


def listed(names: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def milliseconds(ms: float) -> str:
    """Three significant digits, which is what a timer gives."""
    return f"{significant(ms, 3)}\u00a0ms"


def percent(fraction: float) -> str:
    """A fraction as a percentage of two or three digits."""
    return f"{significant(100 * fraction, 3 if abs(fraction) >= 1 else 2)}\u00a0%"


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
