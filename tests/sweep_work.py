"""What workers do in tests of sweeps, in place of drawing. Workers are other processes, so they import it by name."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

FIGURES = {
    "triangles": 4968,
    "gpu_ms": {"median": 1.0, "min": 0.9, "p95": 1.2},
    "frame_ms": None,
    "host_ms": None,
    "memory_bytes": 1 << 20,
    "errors": None,
    "adapter": "none",
    "driver": "none",
    "versions": {"tyndall": "0.1.0"},
}


def _log(task: Mapping[str, Any]) -> int:
    """Note down that a point is measured, by its height, in the file ``$SWEEP_LOG``; how often it has been."""
    height = str(task["point"]["size"][1])
    path = Path(os.environ["SWEEP_LOG"])
    with path.open("a", encoding="utf-8") as file:
        file.write(f"{height}\n")
    path.with_suffix(f".{os.getpid()}").touch()
    return path.read_text(encoding="utf-8").split().count(height)


def quick(task: Mapping[str, Any]) -> dict[str, Any]:
    """Measures at once."""
    _log(task)
    return dict(FIGURES)


def drawn(task: Mapping[str, Any]) -> dict[str, Any]:
    """Measures at once, on the adapter that was asked for."""
    _log(task)
    return {**FIGURES, "adapter": task["adapter"]}


def littered(task: Mapping[str, Any]) -> dict[str, Any]:
    """What lies in the folder for temporary files meanwhile."""
    return {**FIGURES, "folders": sorted(path.name for path in Path(os.environ["TMPDIR"]).iterdir())}


def slow(task: Mapping[str, Any]) -> dict[str, Any]:
    """Takes a fifth of a second."""
    _log(task)
    time.sleep(0.2)
    return dict(FIGURES)


def deadly(task: Mapping[str, Any]) -> dict[str, Any]:
    """Dies at height 1 always and at height 2 at first; at height 3 it first raises what nobody foresaw."""
    times = _log(task)
    height = task["point"]["size"][1]
    if height == 1 or (height == 2 and times == 1):
        os.kill(os.getpid(), signal.SIGKILL)
    if height == 3 and times == 1:
        raise KeyError("lost")
    return dict(FIGURES)


def large(task: Mapping[str, Any]) -> dict[str, Any]:
    """A row of some kilobytes."""
    _log(task)
    return {**FIGURES, "passes": {f"pass {i}": i for i in range(300)}}


def address(task: Mapping[str, Any]) -> dict[str, Any]:
    """On which interfaces the worker listens."""
    import psutil

    listening = [c.laddr.ip for c in psutil.Process().net_connections("inet") if c.status == psutil.CONN_LISTEN]
    return {"ports": sorted(set(listening))}
