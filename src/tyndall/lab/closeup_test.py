"""Close-ups find the error where it is."""

from __future__ import annotations

import numpy as np
import pytest

from tyndall.lab.closeup import heat, nice_ceiling, strip, worst_places


def test_the_worst_place_holds_the_error() -> None:
    error = np.zeros((90, 160), np.float32)
    error[60:66, 100:106] = 3
    error[10:16, 20:26] = 2
    first, second = worst_places(error)
    assert first.crop(error).sum() == pytest.approx(3 * 36)
    assert second.crop(error).sum() == pytest.approx(2 * 36)


def test_places_do_not_overlap_and_stay_inside() -> None:
    error = np.random.default_rng(5).uniform(0.5, 1, (90, 160)).astype(np.float32)
    covered = np.zeros_like(error, np.int32)
    places = worst_places(error, 6)
    assert len(places) == 6
    for place in places:
        place.crop(covered)[...] += 1
        assert place.crop(error).shape == (place.height, place.width)
    assert covered.max() == 1


def test_no_error_has_no_places() -> None:
    assert worst_places(np.zeros((40, 60), np.float32)) == []


def test_a_tiny_picture_is_one_place() -> None:
    (place,) = worst_places(np.ones((4, 5), np.float32))
    assert (place.x, place.y, place.width, place.height) == (0, 0, 5, 4)


@pytest.mark.parametrize(("value", "expected"), [(0.03, 0.05), (0.05, 0.05), (0.6, 1), (1.2, 2), (0, 1e-6)])
def test_scales_are_read_off(value: float, expected: float) -> None:
    assert nice_ceiling(value) == pytest.approx(expected)


def test_heat_rises_in_luminance_and_saturates() -> None:
    ramp = heat(np.linspace(0, 2, 101, dtype=np.float32)[None], 1.0)[0].astype(float)
    luminance = ramp @ (0.2126, 0.7152, 0.0722)
    assert luminance[0] == 0
    assert (np.diff(luminance[:51]) > 0).all()
    assert (ramp[51:] == ramp[51]).all()


def test_the_strip_shows_both_pictures_and_magnifies_the_worst_place() -> None:
    reference = np.full((90, 160, 3), (0, 200, 0), np.uint8)
    technique = np.full((90, 160, 3), (200, 0, 0), np.uint8)
    error = np.zeros((90, 160), np.float32)
    error[30:40, 50:60] = 1
    picture = strip(reference, technique, error, ("march", "froxel", "L_v"))
    height, width = picture.shape[:2]
    lower = picture[height * 3 // 4]  # through the magnified crops
    assert tuple(lower[width // 6]) == (0, 200, 0)
    assert tuple(lower[width // 2]) == (200, 0, 0)
