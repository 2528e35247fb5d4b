"""How soon a scene of implicit surfaces shows its first picture, and what its frames take then: a process of its own.

    python -m tyndall.lab.first_picture '{"scene": "swarm:1000", "who": "ours"}'

It prints one line of JSON. A compiler that takes minutes can be ended from outside this way, and nothing is warm but
what the driver keeps on disk.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

_BEGIN = time.perf_counter()

import tyndall  # noqa: E402
from tyndall.frame import Renderer  # noqa: E402
from tyndall.gpu.device import Built, Gpu  # noqa: E402
from tyndall.lab.baseline import Baseline, Loop  # noqa: E402
from tyndall.lab.busy import Busy  # noqa: E402
from tyndall.lab.filelock import device_lock  # noqa: E402
from tyndall.lab.measure import Times, measure  # noqa: E402
from tyndall.lab.scenes import open_scene  # noqa: E402
from tyndall.scene.model import Scene  # noqa: E402
from tyndall.techniques import FAMILIES  # noqa: E402

SLOW_MS = 1500.0  # a frame of the plain loop that would take longer is measured smaller
_SMALLER = 4  # as wide and high
_SMALL = 64, 36
_IMPATIENT = 75  # the status of a process whose patience has ended


@dataclass(frozen=True)
class Order:
    """What is drawn.

    Attributes:
        who: "ours", or the plain loop as "fragment" or "compute".
        loops: whether unions of very many leaves are lists that the plain loop runs over; otherwise all is code.
        seconds: of measuring frames; 0: the first picture alone.
        techniques: of our frame, by family.
        changes: their parameters, by technique.
        patience: seconds until the pipelines are there, if not 0; then the process ends.
        in_turn: processes that were told so compile at the same time, but only one of them draws; their first pictures
            are small.
    """

    scene: str
    who: str = "ours"
    loops: bool = False
    size: tuple[int, int] = (1920, 1080)
    seconds: float = 0.0
    frames: int = 100_000
    adapter: str | None = None
    techniques: Mapping[str, str] | None = None
    changes: Mapping[str, Mapping[str, Any]] | None = None
    patience: float = 0.0
    in_turn: bool = False


def techniques_of(
    scene: Scene, techniques: Mapping[str, str], changes: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """The techniques of a frame by family, as :class:`~tyndall.frame.Renderer` takes them."""
    return {family: FAMILIES[family].make(name, scene.looks, changes.get(name)) for family, name in techniques.items()}


def run(order: Order, gpu: Gpu | None = None, scene: Scene | None = None) -> dict[str, Any]:
    """Draw the first picture, a second first one on the same device, and frames.

    Returns:
        ``first_ms``: from a scene and a device to a picture; ``compile_ms`` of it for the plain loop; ``warm_ms``: the
        same again, with pipelines that the device has; ``import_ms``, ``device_ms`` and ``scene_ms`` before it, where
        the process begins with them; ``frame_ms``. Parts of ``first_ms``: ``setup_ms`` until there is a renderer,
        ``record_ms`` until its first frame is recorded, which waits for pipelines; ``link_ms``, ``modules_ms`` and
        ``pipelines_ms`` are what all ``pipelines`` together took, in as many threads as there are, and ``slowest`` is
        the one that took longest, with its milliseconds.
    """
    size = (int(order.size[0]), int(order.size[1]))
    made = gpu is None
    begin = time.perf_counter()
    device = gpu or Gpu(order.adapter)
    found: dict[str, Any] = {}
    turn = contextlib.ExitStack()
    end = threading.Timer(order.patience, partial(os._exit, _IMPATIENT))
    end.daemon = True
    try:
        if made:
            device.wait()
            found["device_ms"] = _since(begin)
        begin = time.perf_counter()
        described = scene or open_scene(order.scene)
        found["scene_ms"] = _since(begin)
        first_size = _SMALL if order.in_turn else size  # one frame of a plain loop may take a minute
        for name in ("first_ms", "warm_ms"):
            begin, before = time.perf_counter(), len(device.built)
            if order.patience > 0 and name == "first_ms":
                end.start()
            with _make(order, device, described, first_size) as drawn:
                setup_ms = _since(begin)
                end.cancel()
                if order.in_turn and name == "first_ms":
                    asked = time.perf_counter()
                    turn.enter_context(device_lock(f"pictures of {order.adapter}"))
                    begin += time.perf_counter() - asked
                drawn.draw()
                record_ms = round(_since(begin) - setup_ms, 3)
                device.wait()
                found[name] = _since(begin)
                if name == "first_ms":
                    found |= {"setup_ms": setup_ms, "record_ms": record_ms, **_parts(device.built[before:])}
                if name == "first_ms" and isinstance(drawn, Baseline):
                    found["compile_ms"] = round(drawn.compile_ms, 3)
                if name == "warm_ms" and order.seconds > 0:
                    found |= frames_of(order, device, described)
    finally:
        turn.close()
        if made:
            device.close()
    return found


def _parts(built: Sequence[Built]) -> dict[str, Any]:
    """What pipelines took, all together, and the one that took longest."""
    sums = {
        "link_ms": round(sum(each.link_ms for each in built), 3),
        "modules_ms": round(sum(each.module_ms for each in built), 3),
        "pipelines_ms": round(sum(each.pipeline_ms for each in built), 3),
    }
    took = {each.label: round(each.link_ms + each.module_ms + each.pipeline_ms, 3) for each in built}
    slowest = max(took, key=lambda label: took[label], default=None)
    return {"pipelines": len(built), **sums, "slowest": {slowest: took[slowest]} if slowest else {}}


def _make(order: Order, gpu: Gpu, scene: Scene, size: tuple[int, int], settings: Loop | None = None) -> Any:
    if order.who == "ours":
        chosen = techniques_of(scene, order.techniques or {}, order.changes or {})
        return Renderer(scene, size, gpu=gpu, **chosen)
    stage: Any = order.who
    return Baseline(gpu, scene, size, stage=stage, moving=order.loops, settings=settings)


def frames_of(order: Order, gpu: Gpu, scene: Scene) -> dict[str, Any]:
    """The time of frames; of the plain loop where a frame would take very long, of a smaller picture, by its pixels."""
    size = (int(order.size[0]), int(order.size[1]))
    small = (max(1, size[0] // _SMALLER), max(1, size[1] // _SMALLER))
    if order.who != "ours":
        with _make(order, gpu, scene, small, Loop.of(scene, size)) as probe:  # with the large picture's cones
            for _ in range(2):
                probe.draw()
                taken = probe.timings().get("frame", 0.0)
            share = size[0] * size[1] / (small[0] * small[1])
            if taken * share > SLOW_MS:
                found = _measured(order, gpu, probe)
                scaled = {key: value * share for key, value in found["frame_ms"].items()}
                return {**found, "frame_ms": scaled, "measured_size": list(small)}
    with _make(order, gpu, scene, size) as whole:
        return _measured(order, gpu, whole)


def _measured(order: Order, gpu: Gpu, drawn: Any) -> dict[str, Any]:
    with Busy(gpu) as busy:
        taken = measure(drawn, frames=order.frames, warmup=3, budget_s=order.seconds, before=busy)
    frame = taken.frame or Times(0.0, 0.0, 0.0)
    return {"frame_ms": frame.to_json(), "host_ms": taken.host.to_json(), "frames": taken.frames}


def _since(begin: float) -> float:
    return round((time.perf_counter() - begin) * 1e3, 3)


def in_a_process(order: Order, *, timeout: float = 120.0, keep_compiled: bool = True) -> dict[str, Any]:
    """:func:`run` in a process of its own, with ``process_ms``, its whole life as seen from outside.

    Args:
        timeout: seconds, after which it is ended; the result is then ``{"failed": …}``.
        keep_compiled: whether the driver may use what it keeps on disk of earlier processes' pipelines (NVIDIA, Mesa).
    """
    environment = dict(os.environ)
    environment["PYTHONPATH"] = os.pathsep.join(
        [str(Path(tyndall.__file__).parents[1]), *filter(None, [environment.get("PYTHONPATH")])]
    )
    if not keep_compiled:
        environment |= {"__GL_SHADER_DISK_CACHE": "0", "MESA_SHADER_CACHE_DISABLE": "true"}
    begin = time.perf_counter()
    words = [sys.executable, "-m", "tyndall.lab.first_picture", json.dumps(asdict(order))]
    try:
        done = subprocess.run(words, capture_output=True, text=True, env=environment, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        return {"failed": f"no picture within {timeout:g} s", "timeout_s": timeout}
    lines = done.stdout.strip().splitlines()
    if done.returncode == _IMPATIENT:
        return {"failed": f"no picture within {order.patience:g} s", "timeout_s": order.patience}
    if done.returncode or not lines:
        said = done.stderr.strip().splitlines()
        return {"failed": said[-1] if said else f"it ended with {done.returncode}"}
    found: dict[str, Any] = json.loads(lines[-1])
    return {**found, "process_ms": _since(begin)}


if __name__ == "__main__":
    imported = _since(_BEGIN)
    print(json.dumps({"import_ms": imported, **run(Order(**json.loads(sys.argv[1])))}))
