"""What every result begins with: when, on what, and of which scenes it is."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date
from typing import Any

from tyndall.gpu.device import Gpu
from tyndall.lab.fingerprint import scene_hash, versions
from tyndall.lab.stage import adapter_name, driver_name
from tyndall.scene.model import Scene


def heading(benchmark: str, gpu: Gpu, scenes: Iterable[Scene]) -> dict[str, Any]:
    """Plain data."""
    return {
        "benchmark": benchmark,
        "date": date.today().isoformat(),
        "adapter": adapter_name(gpu),
        "driver": driver_name(gpu),
        "versions": versions(),
        "scenes": [{"scene": scene.name, "scene_hash": scene_hash(scene)} for scene in scenes],
    }
