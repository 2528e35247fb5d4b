"""The colour map is what it says: even steps, ordered by lightness, also for eyes that see fewer colours."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from tyndall.lab.report.heat import Scale, colour_map, encode_map, oklab_to_linear


def linear(colours: np.ndarray) -> np.ndarray:
    x = colours / 255
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def oklab(rgb: np.ndarray) -> np.ndarray:
    """Ottosson's published matrices of the way there; the module has those of the way back."""
    to_lms = [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
    to_lab = [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
    return np.cbrt(rgb @ np.transpose(to_lms)) @ np.transpose(to_lab)


def test_oklab_there_and_back() -> None:
    rgb = np.random.default_rng(1).random((100, 3))
    assert oklab_to_linear(oklab(rgb)) == pytest.approx(rgb, abs=1e-5)


def test_steps_are_even_and_lightness_rises() -> None:
    lab = oklab(linear(colour_map()))
    assert (np.diff(lab[:, 0]) > 0).all()
    assert lab[0, 0] < 0.1
    assert lab[-1, 0] > 0.95
    # Over sixteen colours, so that rounding to bytes is small beside a step.
    steps = np.linalg.norm(lab[16:] - lab[:-16], axis=1)
    assert np.abs(steps / steps.mean() - 1).max() < 0.08


@pytest.mark.parametrize(
    "confusion",
    [
        # Viénot, Brettel and Mollon 1999: what protanopes and deuteranopes see of linear sRGB.
        [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
        [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
        [[0.2126, 0.7152, 0.0722]] * 3,
    ],
    ids=["protanopia", "deuteranopia", "grey"],
)
def test_the_order_is_seen_by_every_eye(confusion: list[list[float]]) -> None:
    seen = np.clip(linear(colour_map()) @ np.transpose(confusion), 0, 1)
    lightness = oklab(seen)[::8, 0]
    assert (np.diff(lightness) > 0).all()


def test_all_colours_differ() -> None:
    assert len(np.unique(colour_map(), axis=0)) == 256


@given(st.lists(st.floats(1e-6, 1e3), min_size=4, max_size=64))
def test_a_colour_stands_for_its_error_within_half_a_step(values: list[float]) -> None:
    error = np.array([values], np.float32)
    scale = Scale.over([error])
    number = scale.index(error)
    back = scale.low * (scale.high / scale.low) ** (number / 255.0)
    inside = (error > scale.low) & (error < scale.high)
    half = (scale.high / scale.low) ** (0.5 / 255) * 1.0001
    assert (np.abs(np.log(back[inside] / error[inside])) <= np.log(half)).all()
    assert (number[error <= scale.low] == 0).all()
    assert (number[error >= scale.high] == 255).all()


def test_one_scale_spans_the_best_and_the_worst() -> None:
    good, bad = np.full((8, 8), 0.03, np.float32), np.full((8, 8), 4.1, np.float32)
    scale = Scale.over([good, bad])
    assert (scale.low, scale.high) == (pytest.approx(1e-2), 5.0)
    assert [value for value, _ in scale.ticks()] == pytest.approx([0.01, 0.1, 1, 5])
    assert [value for value, _ in Scale(0.01, 2.0).ticks()] == pytest.approx([0.01, 0.1, 1]), "no two on one another"
    assert all(0 <= place <= 1 for _, place in scale.ticks())


def test_no_error_at_all_still_has_a_scale() -> None:
    scale = Scale.over([np.zeros((4, 4), np.float32)])
    assert 0 < scale.low < scale.high
    assert not scale.index(np.zeros((4, 4), np.float32)).any()


def test_the_png_holds_the_map() -> None:
    error = np.geomspace(1e-3, 1, 256, dtype=np.float32).reshape(16, 16)
    scale = Scale(1e-3, 1.0)
    pixels = np.asarray(Image.open(io.BytesIO(encode_map(error, scale))).convert("RGB"))
    assert np.array_equal(pixels, colour_map()[scale.index(error)])
