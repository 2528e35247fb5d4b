"""An entry is built once, read back by memory map bit for bit, and built again when anything about it is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tyndall.scene.bundled.cache import Arrays, cached, directory, version_of


class _Builder:
    """Counts how often it had to build."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> Arrays:
        self.calls += 1
        return {"a.positions": np.arange(12, dtype=np.float32).reshape(4, 3), "b": np.arange(5, dtype=np.uint32)}


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TYNDALL_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def _assert_equal(got: Arrays) -> None:
    expected = _Builder()()
    assert list(got) == list(expected)
    for name, array in expected.items():
        assert got[name].dtype == array.dtype
        np.testing.assert_array_equal(got[name], array)


def test_second_read_is_a_memory_map_of_the_same_bits(root: Path) -> None:
    build = _Builder()
    _assert_equal(cached("scene", "v1", "0", build))
    again = cached("scene", "v1", "0", build)
    _assert_equal(again)
    assert build.calls == 1
    assert all(isinstance(array, np.memmap) for array in again.values())


def _truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-5])


def _flip_a_bit(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("name", ["a.positions.npy", "b.npy", "manifest.json"])
@pytest.mark.parametrize("damage", [_truncate, _flip_a_bit, Path.unlink, lambda path: path.write_bytes(b"")])
def test_a_damaged_entry_is_built_again(root: Path, name: str, damage: object) -> None:
    build = _Builder()
    cached("scene", "v1", "0", build)
    assert callable(damage)
    damage(root / "scenes" / "scene" / "v1" / "0" / name)
    _assert_equal(cached("scene", "v1", "0", build))
    assert build.calls == 2
    _assert_equal(cached("scene", "v1", "0", build))
    assert build.calls == 2


@pytest.mark.parametrize("text", ["[]", "3", '{"a.positions": "x"}', '{"../../b": 1}', "{"])
def test_a_foreign_manifest_is_built_again(root: Path, text: str) -> None:
    build = _Builder()
    cached("scene", "v1", "0", build)
    (root / "scenes" / "scene" / "v1" / "0" / "manifest.json").write_text(text)
    _assert_equal(cached("scene", "v1", "0", build))
    assert build.calls == 2


def test_a_cache_that_cannot_be_written_is_no_error(root: Path) -> None:
    root.write_text("a file where the directory should be")
    build = _Builder()
    _assert_equal(cached("scene", "v1", "0", build))
    _assert_equal(cached("scene", "v1", "0", build))
    assert build.calls == 2
    assert root.is_file()


def test_keys_are_kept_apart_and_old_versions_removed(root: Path) -> None:
    build = _Builder()
    for version, key in (("v1", "0"), ("v1", "1"), ("v2", "0")):
        cached("scene", version, key, build)
    cached("other", "v1", "0", build)
    assert build.calls == 4
    assert sorted(str(p.relative_to(root / "scenes")) for p in root.glob("scenes/*/*/*")) == [
        "other/v1/0",
        "scene/v2/0",
    ]


def test_an_interrupted_build_leaves_nothing(root: Path) -> None:
    def interrupted() -> Arrays:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cached("scene", "v1", "0", interrupted)
    assert not list(root.rglob("*"))


def test_an_interrupted_write_leaves_nothing(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*args: object, **kwargs: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(np, "save", interrupted)
        with pytest.raises(KeyboardInterrupt):
            cached("scene", "v1", "0", _Builder())
    assert not [p for p in root.rglob("*") if p.is_file()]
    assert not list(root.glob("scenes/scene/v1/*"))


def test_version_follows_the_source(tmp_path: Path) -> None:
    source = tmp_path / "generator.py"
    source.write_text("a")
    first = version_of([source])
    assert version_of([source]) == first
    source.write_text("b")
    assert version_of([source]) != first


def test_directory_is_the_environments_or_the_users(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert directory() == root
    monkeypatch.delenv("TYNDALL_CACHE")
    assert directory().is_absolute()
    assert "tyndall" in str(directory()).lower()
