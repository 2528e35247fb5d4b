"""The benchmark of implicit surfaces, and wgpu-shadertoy on the same scenes, in one run. Prints one JSON document.

    python benchmarks/sdf.py [--quick] [--seconds 5] [--parts scenes,swarm] [--scenes snail] [--swarm 10,1000]
                             [--peer only|none] [--out DIR]
    python benchmarks/sdf.py --join FIRST.json SECOND.json …

It is what ``tyndall bench sdf`` measures, with wgpu-shadertoy's whole frames under ``peer`` (see
``peer_shadertoy.py``). The document and its tables are also saved in ``--out``, or else in the folder that ``$OUT``
names: ``sdf.json`` and ``sdf.md``; the document grows there as figures come. ``--join`` makes one document of those of
several runs on one adapter, each of some ``--parts``.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import peer_shadertoy

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import nearest
from tyndall.lab import bench_sdf
from tyndall.lab.bench_sdf import SdfBench


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the same in small")
    parser.add_argument("--seconds", type=float, help="of each measurement of our frames")
    parser.add_argument("--loop-seconds", type=float, help="of each measurement of the plain loop")
    parser.add_argument("--timeout", type=float, help="seconds after which a compiler is ended")
    parser.add_argument("--parts", type=names, help=f"some of {','.join(bench_sdf.PARTS)}")
    parser.add_argument("--scenes", type=names, help="names, comma-separated, or none")
    parser.add_argument("--swarm", type=numbers(","), help="numbers of primitives, comma-separated, or none")
    parser.add_argument("--size", type=numbers("x"), help="WxH")
    parser.add_argument("--peer", choices=("too", "only", "none"), default="too")
    parser.add_argument("--out", type=Path, default=os.environ.get("OUT"))
    parser.add_argument("--join", type=Path, nargs="+", help="documents of some parts each")
    chosen = parser.parse_args()
    if chosen.join:
        try:
            joined = bench_sdf.join([json.loads(path.read_text(encoding="utf-8")) for path in chosen.join])
        except (OSError, ValueError) as error:  # a ParameterError is one
            parser.error(f"--join: {error}")
        keep(joined, chosen.out)
        return
    unknown = [part for part in chosen.parts or () if part not in bench_sdf.PARTS]
    if unknown:
        parser.error(f"--parts: no '{unknown[0]}'{nearest(unknown[0], bench_sdf.PARTS)}")
    base = bench_sdf.QUICK if chosen.quick else bench_sdf.Settings()
    changes: dict[str, object] = {
        "parts": () if chosen.peer == "only" else chosen.parts,
        "scenes": chosen.scenes,
        "swarm": chosen.swarm,
        "size": chosen.size,
        "seconds": chosen.seconds,
        "loop_seconds": chosen.loop_seconds or (min(chosen.seconds, base.loop_seconds) if chosen.seconds else None),
        "timeout": chosen.timeout,
    }
    settings = dataclasses.replace(base, **{k: v for k, v in changes.items() if v is not None})  # type: ignore[arg-type]
    begin = time.monotonic()

    def tell(fraction: float, text: str) -> None:
        print(f"{time.monotonic() - begin:6.1f} s  {100 * fraction:3.0f} %  {text}", file=sys.stderr, flush=True)

    with Gpu() as gpu:
        found = bench_sdf.sdf(gpu, chosen.out, settings=settings, progress=tell)
    document = found.to_json()
    if chosen.peer != "none":
        scenes = [*settings.scenes, *(f"swarm:{count}" for count in settings.swarm if count <= 1000)]
        document["peer"] = peer_shadertoy.measure_apart(
            scenes,
            settings.size,
            seconds=settings.loop_seconds,
            timeout=settings.timeout,
            progress=lambda text: tell(1.0, text),
        )
    document["seconds"] = round(time.monotonic() - begin, 1)
    keep(document, chosen.out)


def names(text: str) -> tuple[str, ...]:
    """Of a list with commas; "none" is an empty one."""
    return tuple(text.split(",")) if text != "none" else ()


def numbers(between: str) -> Callable[[str], tuple[int, ...]]:
    """Of a list with something between them; "none" is an empty one."""

    def whole_numbers(text: str) -> tuple[int, ...]:
        return tuple(int(number) for number in text.split(between)) if text != "none" else ()

    return whole_numbers


def keep(document: dict[str, Any], out: Path | None) -> None:
    """Save a document and its tables, and print it."""
    if out:
        SdfBench(document).save(out)
    print(json.dumps(document, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
