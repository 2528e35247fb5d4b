"""Pictures of fields: the contour is where the sign changes, and a true distance has a gradient of 1."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tyndall.gpu.params import ParameterError
from tyndall.sdf import Shape, box, sphere
from tyndall.sdf.slices import _LEFT, _TOP, Slice

N = 128


def field(picture: Slice) -> np.ndarray:
    """(N, N, 3): the field without its legend."""
    n = len(picture.values)
    return picture.pixels[_TOP : _TOP + n, _LEFT : _LEFT + n].astype(float)


def test_values_are_the_shapes() -> None:
    shape = sphere(1).at(0.5, 0.2, 0.1)
    picture = shape.show_slice(z=0.3, size=4, pixels=N)
    axis = ((np.arange(N) + 0.5) / N - 0.5) * 4
    x, y = np.meshgrid(0.5 + axis, 0.2 - axis)  # around the shape's middle; the first row is the top
    expected = shape(np.stack([x, y, np.full_like(x, 0.3)], axis=-1).reshape(-1, 3)).reshape(N, N)
    np.testing.assert_allclose(picture.values, expected, atol=1e-12)
    assert (picture.least, picture.greatest) == (picture.values.min(), picture.values.max())


def test_outside_is_orange_inside_is_blue_and_the_contour_is_where_the_sign_changes() -> None:
    picture = (sphere(1) - box(0.7)).show_slice(pixels=N)
    red, _, blue = np.moveaxis(field(picture), -1, 0)
    clear = np.abs(picture.values) > 3 * 3 / N
    warm = red - blue
    assert (warm[clear & (picture.values > 0)] > 0).mean() > 0.97  # lines are grey
    assert (warm[clear & (picture.values < 0)] < 0).mean() > 0.97
    # Right where the sign changes from one pixel to the next, one of both is white or the line's black.
    changes = np.argwhere(np.diff((picture.values < 0).astype(int), axis=1))
    pair = np.stack([field(picture)[changes[:, 0], changes[:, 1] + k] for k in (0, 1)])
    whiteness = pair.min(axis=-1).max(axis=0)
    assert (whiteness > 180).mean() > 0.95


@pytest.mark.parametrize(("held", "across", "up"), [("x", (0, 0, -1), (0, 1, 0)), ("y", (1, 0, 0), (0, 0, -1))])
def test_the_other_planes(held: str, across: tuple[float, ...], up: tuple[float, ...]) -> None:
    place = 0.6 * np.array(across) + 0.3 * np.array(up)
    shape = sphere(0.2).at(*place)
    values = shape.show_slice(**{held: 0.0}, size=2, pixels=64).values
    middle = (sphere(0.2).at(*place) | sphere(0.2).at(*-place)).show_slice(**{held: 0.0}, size=2, pixels=64).values
    assert np.unravel_index(values.argmin(), values.shape) == pytest.approx((31.5, 31.5), abs=1)
    down, right = np.unravel_index(middle[:, 32:].argmin(), (64, 32))
    assert (right + 32, down) == pytest.approx((31.5 + 0.6 * 32, 31.5 - 0.3 * 32), abs=1)


@pytest.mark.parametrize("shape", [sphere(1), box((1, 2, 3)).rotate(0.4).scale(0.5)], ids=["sphere", "box"])
def test_the_gradient_of_a_distance_is_one(shape: Shape) -> None:
    picture = shape.show_gradient(z=0.05, pixels=64)
    assert picture.greatest == pytest.approx(1, abs=1e-6)
    assert (picture.values > 0.999).mean() > 0.98  # less only where two sides are equally far
    assert (field(picture)[(picture.values > 0.999) & (from_the_contour(picture) > 4)] > 253).all()


def from_the_contour(picture: Slice) -> np.ndarray:
    """Pixels to the nearest dark one, roughly: the contour."""
    dark = np.argwhere(field(picture).max(axis=-1) < 200)
    rows, columns = np.indices(picture.values.shape)
    apart = np.hypot(rows[..., None] - dark[:, 0], columns[..., None] - dark[:, 1])
    return np.asarray(apart.min(axis=-1))


def test_the_gradient_of_a_bound_is_less() -> None:
    picture = sphere(1).scale((1, 2, 1)).show_gradient(pixels=N)
    assert picture.greatest <= 1 + 1e-6
    assert picture.least == pytest.approx(0.5, abs=0.05)
    red, _, blue = field(picture)[picture.values < 0.7].mean(axis=0)
    assert blue > red


def test_it_shows_itself_and_saves(tmp_path: Path) -> None:
    picture = sphere(1).show_slice(pixels=64)
    picture.save(tmp_path / "slice.png")
    for source in (tmp_path / "slice.png", io.BytesIO(picture._repr_png_())):
        np.testing.assert_array_equal(np.array(Image.open(source)), picture.pixels)
    assert picture.image.size == picture.size


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"x": 0, "z": 0}, "z: one coordinate is held, and x is already"),
        ({"z": float("nan")}, "z: nan is not a finite number"),
        ({"size": 0}, "size: 0 is not above 0 m"),
        ({"pixels": 8}, "pixels: 8 is outside 64 … 2,048"),
    ],
)
def test_one_line_says_what_is_wrong(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        sphere(1).show_slice(**changes)
    with pytest.raises(ParameterError, match=message):
        sphere(1).show_gradient(**changes)
