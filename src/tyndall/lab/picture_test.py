"""Pictures survive their files, and a file is whole or not there."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tyndall.lab.picture import OutputError, Picture, write_atomically


@pytest.fixture
def picture() -> Picture:
    rng = np.random.default_rng(3)
    depth = rng.uniform(1, 1000, (5, 7)).astype(np.float32)
    depth[0, 0] = np.inf
    return Picture(
        rng.integers(0, 256, (5, 7, 3), dtype=np.uint8),
        rng.uniform(0, 50, (5, 7, 3)).astype(np.float32),
        depth,
        {"scene": "box", "technique": "froxel", "adapter": "llvmpipe · LLVM"},
    )


def test_png_keeps_every_pixel_and_says_how_it_was_made(picture: Picture, tmp_path: Path) -> None:
    with Image.open(picture.save(tmp_path / "a.png")) as image:
        assert np.array_equal(np.asarray(image), picture.pixels)
        assert image.info["technique"] == "froxel"
        assert image.info["adapter"] == "llvmpipe · LLVM"


def test_exr_keeps_linear_light_to_half_precision_and_depth_exactly(picture: Picture, tmp_path: Path) -> None:
    import OpenEXR

    path = picture.save(tmp_path / "a.exr")
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
        assert file.header()["tyndall.scene"] == "box"
    assert set(channels) == {"R", "G", "B", "Z"}
    assert channels["R"].dtype == np.float16
    assert channels["Z"].dtype == np.float32
    assert np.array_equal(channels["Z"], picture.depth)
    light = np.stack([channels[c] for c in "RGB"], axis=-1).astype(np.float32)
    np.testing.assert_allclose(light, picture.radiance, rtol=2**-11)


def test_exr_of_light_beyond_half_stays_finite(picture: Picture, tmp_path: Path) -> None:
    import OpenEXR

    bright = Picture(picture.pixels, np.full((5, 7, 3), 1e6, np.float32), picture.depth)
    with OpenEXR.File(str(bright.save(tmp_path / "a.exr")), separate_channels=True) as file:
        assert np.isfinite(file.channels()["R"].pixels).all()


def test_notebooks_get_a_png(picture: Picture) -> None:
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(picture._repr_png_()))), picture.pixels)


@pytest.mark.parametrize("name", ["a.jpg", "a", "missing/a.png", "missing/a.exr"])
def test_a_wrong_place_gets_one_line(picture: Picture, tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError) as error:
        picture.save(tmp_path / name)
    assert str(tmp_path / name) in str(error.value)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_not_overwritten(picture: Picture, tmp_path: Path) -> None:
    (tmp_path / "a.png").mkdir()
    with pytest.raises(OutputError, match="folder"):
        picture.save(tmp_path / "a.png")


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def interrupted(temporary: Path) -> None:
        temporary.write_text("half of the n")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, interrupted)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
