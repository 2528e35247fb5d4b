"""Sentences say what the figures say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tyndall.lab.report.results import Study
from tyndall.lab.report.verdict import BY_KEY, best, front, remarks, significant, verdict

points = st.lists(st.tuples(st.integers(1, 9), st.integers(1, 9)), min_size=1, max_size=12)


@given(points)
def test_the_front_is_what_nothing_dominates(pairs: list[tuple[int, int]]) -> None:
    named = [(str(i), float(c), float(e)) for i, (c, e) in enumerate(pairs)]
    wanted = {
        label for label, c, e in named if not any(oc <= c and oe <= e and (oc < c or oe < e) for _, oc, oe in named)
    }
    assert set(front(named)) == wanted


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0, 3, "0"),
        (0.0006, 3, "0.000600"),
        (9.996, 3, "10.0"),
        (1358, 3, "1360"),
        (-0.21, 2, "−0.21"),
        (99.96, 3, "100"),
    ],
)
def test_significant_digits(value: float, digits: int, text: str) -> None:
    assert significant(value, digits) == text


def study(*results: tuple[str, float | None, float | None], noise: float = 0.0, **more: Any) -> Study:
    """Techniques by label, time and error; one below the truth's noise is hidden by it."""
    rows = []
    for label, ms, error in results:
        row: dict[str, Any] = {"label": label, "technique": label, "gpu_ms": ms, **more.get(label, {})}
        if error is not None:
            hidden = error < noise
            row["errors"] = {
                "inscattered": {
                    "rel_rmse_corrected": 0.0 if hidden else error,
                    "rel_rmse": error,
                    "within_noise": hidden,
                    "rel_rmse_limit": noise,
                }
            }
        rows.append(row)
    reference = {"judge": "traced", "relative_error": {"inscattered": noise}}
    return Study.model_validate(
        {"folder": Path(), "scene": "s", "size": [4, 3], "results": rows, "reference": reference}
    )


def plain(text: str) -> str:
    return text.replace("\u00a0", " ")


def test_a_front_of_two_names_the_third_as_beaten() -> None:
    found = study(("quick", 0.1, 0.3), ("good", 0.5, 0.01), ("bad", 0.6, 0.2))
    assert best(found) == ["quick", "good"]
    assert (
        plain(verdict(found)) == "On the Pareto front: quick (0.100 ms, 30 % error) and good (0.500 ms, 1.0 % error)."
    )
    assert remarks(found) == ["good is both faster and more accurate than bad."]


def test_one_that_wins_everything() -> None:
    found = study(("a", 0.1, 0.01), ("b", 0.2, 0.02))
    assert plain(verdict(found)) == "a is the fastest of 2 techniques, and the most accurate: 0.100 ms, 1.0 % error."
    assert remarks(found) == []


def test_what_the_noise_hides_is_not_ranked() -> None:
    found = study(("a", 0.1, 0.03), ("b", 0.2, 0.001), ("c", 0.05, 0.4), noise=0.05)
    assert best(found) == ["c", "a"]
    assert plain(verdict(found)).endswith("a (0.100 ms, < 5.0 % error).")
    said = " ".join(remarks(found))
    assert "a is faster than b, at an error that cannot be told apart." in said
    assert "hides the error of a and b" in said


def test_off_is_no_candidate_but_a_warning() -> None:
    found = study(("off", 0.001, 1.2), ("wild", 0.1, 3.9), ("good", 0.2, 0.1))
    assert best(found) == ["wild", "good"]
    assert "No light at all would be nearer to the truth (120 %) than wild." in plain(" ".join(remarks(found)))


def test_what_is_right_up_to_a_factor_is_said_in_one_sentence() -> None:
    found = study(("a", 0.1, 3.0), ("b", 0.2, 0.1))
    rows = [
        r.model_copy(
            update={
                "up_to_scale": True,
                "errors": {"inscattered": {**r.errors["inscattered"], "scaled_rel_rmse": 0.25, "best_scale": 0.111}},
                "model": "paper",
            }
        )
        for r in found.results[:1]
    ]
    said = plain(" ".join(remarks(found.model_copy(update={"results": [*rows, found.results[1]]}))))
    assert "Right up to a factor only: a (times 0.11 it is 25 % off)." in said
    assert "paper’s own units" in said


def test_without_times_or_errors_it_says_so() -> None:
    assert "No truth was asked for" in verdict(study(("a", 0.1, None), ("b", 0.2, None)))
    assert "a is the most accurate" in verdict(study(("a", None, 0.1), ("b", None, 0.2)))
    assert "Neither errors nor times" in verdict(study(("a", None, None)))
    assert plain(verdict(study(("a", 1.0, 0.1)))) == "a: 1.00 ms, 10 % error."


def test_every_figure_of_the_metrics_has_a_meaning() -> None:
    from dataclasses import fields

    from tyndall.lab.metrics import Scores

    told = {f.name for f in fields(Scores)} - {"missing", "within_noise", "rel_rmse_limit"}
    assert told == set(BY_KEY)
