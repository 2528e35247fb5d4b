"""What a result was made from: the scene's content hash and the versions that took part.

The hash covers all that reaches a picture: geometry, expressions of implicit surfaces, transforms, materials and their
texels, lights, camera, medium, background and ambient light. Names of the scene and its parts, and the looks that
techniques start from, do not count: the techniques' own parameters are written beside the hash. Nor does motion: a
scene's hash is that of the scene at rest, and a moment's that of :meth:`~tyndall.scene.model.Scene.at_time`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import platform
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import metadata
from typing import Any

import numpy as np

import tyndall
from tyndall.scene.model import Image, Implicit, Instance, Material, Mesh, Scene
from tyndall.sdf.shape import Named

_NO_CONTENT = frozenset({"looks", "motion"})
_NAMED = (Scene, Instance, Mesh, Image, Material, Implicit, Named)  # by names that no picture shows
_PACKAGES = ("wgpu", "wesl-py", "numpy", "scikit-image", "flip-evaluator", "mitsuba")


def scene_hash(scene: Scene) -> str:
    """SHA-256 of the scene's content, 64 hexadecimal digits; equal scenes give equal hashes on every platform."""
    digests: dict[int, bytes] = {}  # a mesh or image that many instances share is hashed once
    return _digest(scene, digests).hex()


def _digest(value: Any, digests: dict[int, bytes]) -> bytes:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        for part in _from_below(value, digests):
            members = {f.name: getattr(part, f.name) for f in dataclasses.fields(part) if _counts(part, f)}
            # What a kind of shape is on the device is in its class.
            kind = [getattr(part, name, "") for name in ("code", "module")] if hasattr(part, "children") else []
            digests[id(part)] = _digest({"": [type(part).__name__, *kind], **members}, digests)
        return digests[id(value)]
    sha = hashlib.sha256()
    _feed(value, sha.update, digests)
    return sha.digest()


def _counts(part: Any, f: dataclasses.Field[Any]) -> bool:
    if f.name == "name":
        return not isinstance(part, _NAMED)
    return f.compare and f.name not in _NO_CONTENT  # what tells no two values apart tells no pictures apart


def _from_below(value: Any, digests: Mapping[int, bytes]) -> Iterator[Any]:
    """A value after all that hangs below it and has no digest yet: a shape may be deeper than Python's stack."""
    waiting = [value]
    while waiting:
        missing = [child for child in getattr(waiting[-1], "children", ()) if id(child) not in digests]
        if missing:
            waiting += missing
            continue
        if id(last := waiting.pop()) not in digests:
            yield last


def _feed(value: Any, update: Callable[[Any], object], digests: dict[int, bytes]) -> None:
    """Every value goes in with its type and length, so that no two contents share one stream of bytes."""
    if isinstance(value, np.ndarray):
        little = np.ascontiguousarray(value, value.dtype.newbyteorder("<"))
        update(f"array {little.dtype.str} {little.shape};".encode())
        update(little.data)
    elif isinstance(value, Mapping):
        update(f"map {len(value)};".encode())
        for key in sorted(value):
            update(_digest(key, digests) + _digest(value[key], digests))
    elif isinstance(value, (tuple, list)):
        update(f"list {len(value)};".encode())
        for item in value:
            update(_digest(item, digests))
    elif isinstance(value, float):
        update(b"float;" + struct.pack("<d", value))
    elif isinstance(value, (str, int)) or value is None:
        update(f"{type(value).__name__} {value!r};".encode())
    else:
        raise TypeError(f"a scene holds no {type(value).__name__}")


def versions(packages: Iterable[str] = _PACKAGES) -> dict[str, str]:
    """Versions of Tyndall, Python, the system, and packages that decide pictures, times and errors, where installed."""
    found = {
        "tyndall": tyndall.__version__,
        "python": platform.python_version(),
        "system": platform.platform(terse=True),
    }
    for name in packages:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
