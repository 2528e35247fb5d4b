"""What holds for files of every kind."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tyndall.scene.errors import SceneError
from tyndall.scene.files import SUFFIXES, load


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_missing_file_a_folder_an_empty_and_a_random_file_are_one_line_each(suffix: str, tmp_path: Path) -> None:
    for name, content in (("missing", None), ("empty", b""), ("random", bytes(range(256)) * 3), ("text", b"hello\n")):
        path = tmp_path / f"{name}{suffix}"
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(SceneError) as caught:
            load(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert len(str(caught.value).splitlines()) == 1
    folder = tmp_path / f"folder{suffix}"
    folder.mkdir()
    with pytest.raises(SceneError, match="is a directory, not a file"):
        load(folder)


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    if not hasattr(os, "mkfifo"):
        pytest.skip("this system has no named pipes")
    os.mkfifo(tmp_path / "a.obj")
    with pytest.raises(SceneError, match="is not a regular file"):
        load(tmp_path / "a.obj")


def test_an_unknown_kind_is_told_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(
        SceneError, match=r"not one of the kinds that can be read, .json, .gltf, .* did you mean '.gltf'"
    ):
        load(tmp_path / "a.glft")
    with pytest.raises(SceneError, match="no such file"):
        load("a\0b.obj")


def test_reading_a_mesh_needs_no_pydantic_and_no_pillow() -> None:
    code = (
        "import sys, tyndall.scene.files, tyndall.scene.files.gltf, tyndall.scene.files.obj, tyndall.scene.stage;"
        "print(*[m for m in ('pydantic', 'PIL', 'wgpu') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
