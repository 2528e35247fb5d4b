"""Generated arrays kept on disk, so that a scene of millions of triangles is modelled once.

An entry is a directory of ``.npy`` files and a manifest with their CRC-32; the arrays are memory-mapped when they are
read. It lives at ``$TYNDALL_CACHE``, or else in the user's cache directory, under ``scenes/<name>/<version>/<key>``,
where the version is a hash of the generator's own source: whoever changes the generator makes a new entry, and the old
versions are removed. An entry that is incomplete or damaged is modelled again. A cache that cannot be written is no
error.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]

_MANIFEST = "manifest.json"


def directory() -> Path:
    """Where caches live: ``$TYNDALL_CACHE``, or ``tyndall`` in the platform's user cache directory."""
    if chosen := os.environ.get("TYNDALL_CACHE"):
        return Path(chosen)
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "tyndall"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "tyndall" / "Cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tyndall"


def version_of(sources: Iterable[str | Path]) -> str:
    """A short hash of source files and of numpy's version, on which random streams and rounding depend."""
    digest = hashlib.sha256(np.__version__.encode())
    for source in sources:
        digest.update(Path(source).read_bytes())
    return digest.hexdigest()[:16]


def cached(name: str, version: str, key: str, build: Callable[[], Arrays]) -> Arrays:
    """``build()``, or what it returned before under this name, version and key."""
    entry = directory() / "scenes" / name / version / key
    arrays = _read(entry)
    if arrays is None:
        arrays = build()
        with contextlib.suppress(OSError):
            _write(entry, arrays)
            _remove_other_versions(entry.parent)
    return arrays


def _checksum(array: NDArray[Any]) -> int:
    return zlib.crc32(np.ascontiguousarray(array).view(np.uint8).reshape(-1).data)


def _read(entry: Path) -> Arrays | None:
    try:
        manifest: dict[str, int] = json.loads((entry / _MANIFEST).read_text("utf-8"))
        arrays = {name: np.load(entry / f"{name}.npy", mmap_mode="r", allow_pickle=False) for name in manifest}
        intact = all(_checksum(arrays[name]) == checksum for name, checksum in manifest.items())
    except (OSError, ValueError, TypeError, AttributeError, EOFError):
        return None
    return arrays if intact else None


def _write(entry: Path, arrays: Arrays) -> None:
    """Write beside the final place and rename, so that no reader meets half an entry."""
    entry.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{entry.name}-", dir=entry.parent))
    try:
        for name, array in arrays.items():
            np.save(draft / f"{name}.npy", array, allow_pickle=False)
        manifest = {name: _checksum(array) for name, array in arrays.items()}
        (draft / _MANIFEST).write_text(json.dumps(manifest), "utf-8")
        shutil.rmtree(entry, ignore_errors=True)
        draft.rename(entry)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _remove_other_versions(current: Path) -> None:
    for other in current.parent.iterdir():
        if other != current:
            shutil.rmtree(other, ignore_errors=True)
