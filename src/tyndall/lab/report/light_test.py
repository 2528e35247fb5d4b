"""Light survives the page's format to 0.4 %, and pictures their shrinking."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from tyndall.lab.picture import OutputError
from tyndall.lab.report.light import encode_light, layer, read_exr, read_image, shrink


def decode(packed: bytes, height: int, width: int) -> np.ndarray:
    """As light.js does it."""
    low, high = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(2, 3, height, width).astype(np.int32)
    folded = low | high << 8
    green, red, blue = np.cumsum((folded >> 1) ^ -(folded & 1), axis=2)
    codes = np.stack([green + red, green, green + blue], axis=-1)
    return (codes << 3).astype(np.uint16).view(np.float16).astype(np.float64)


@given(arrays.arrays(np.float32, (5, 7, 3), elements=st.floats(-10, 70000, width=32)))
def test_light_comes_back(radiance: np.ndarray) -> None:
    back = decode(encode_light(radiance), 5, 7)
    wanted = np.clip(radiance, 0, 65504)
    assert back == pytest.approx(wanted, rel=2**-8 + 2**-11, abs=2**-22)


def test_smooth_light_is_small() -> None:
    x = np.linspace(0, 1, 200, dtype=np.float32)
    radiance = np.stack([np.outer(x, x)] * 3, axis=-1)
    assert len(encode_light(radiance)) < 0.6 * radiance.shape[0] * radiance.shape[1]


def test_shrinking_keeps_the_mean_and_the_mean_square() -> None:
    image = np.random.default_rng(2).random((12, 8, 3)).astype(np.float32)
    assert shrink(image, 4).shape == (3, 2, 3)
    assert shrink(image, 4).mean() == pytest.approx(image.mean(), rel=1e-6)
    assert (shrink(image, 2, power=2) ** 2).mean() == pytest.approx((image**2).mean(), rel=1e-6)
    assert shrink(image, 1) is image
    assert shrink(np.full((4, 4, 3), 7, np.uint8), 2).dtype == np.uint8


def test_what_is_no_picture_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(b"nothing")
    (tmp_path / "a.png").write_bytes(b"nothing")
    for read in (read_exr, read_image):
        name = "a.exr" if read is read_exr else "a.png"
        with pytest.raises(OutputError, match="missing"):
            read(tmp_path / f"no-{name}")
        with pytest.raises(OutputError, match="that can be read") as caught:
            read(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_light_that_is_not_finite_is_refused() -> None:
    channels = {name: np.full((2, 2), np.inf) for name in "RGB"}
    with pytest.raises(OutputError, match="finite"):
        layer(channels, "", Path("a.exr"))
    assert layer(channels, "inscatter", Path("a.exr")) is None
