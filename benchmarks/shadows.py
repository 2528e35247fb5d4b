"""The benchmark of the shadow techniques, and pygfx on the same scenes, in one run. Prints one JSON document.

    python benchmarks/shadows.py [--quick] [--parts cells,errors] [--cells 100000x5,10x1] [--techniques pcf,pcss]
                                 [--peer only|none] [--out DIR]

It is what ``tyndall bench shadows`` measures, with pygfx's whole frames under ``peer`` (see ``peer_pygfx.py``). The
document and its tables are also saved in ``--out``, or else in the folder that ``$OUT`` names: ``shadows.json`` and
``shadows.md``, and each figure as it comes. ``--cells`` restricts the triangles and lights of the cells and of the
peer.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
import time
from pathlib import Path

import peer_pygfx

from tyndall.gpu.device import Gpu
from tyndall.lab import bench_shadows
from tyndall.lab.bench_shadows import ShadowBench


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the same in small")
    parser.add_argument("--parts", help=f"some of {','.join(bench_shadows.PARTS)}")
    parser.add_argument("--cells", help="TRIANGLESxLIGHTS,…")
    parser.add_argument("--techniques", help="names or labels, comma-separated")
    parser.add_argument("--peer", choices=("too", "only", "none"), default="too")
    parser.add_argument("--fresh", action="store_true", help="measure again what the folder already has")
    parser.add_argument("--out", type=Path, default=os.environ.get("OUT"))
    parser.add_argument("--frames", type=int, help="of each measurement")
    parser.add_argument("--seconds", type=float, help="the most that a measurement may take")
    chosen = parser.parse_args()
    changes: dict[str, object] = {
        "parts": tuple(chosen.parts.split(",")) if chosen.parts else None,
        "cells": peer_pygfx.parse_cells(chosen.cells) if chosen.cells else None,
        "techniques": tuple(chosen.techniques.split(",")) if chosen.techniques else None,
        "frames": chosen.frames,
        "seconds": chosen.seconds,
    }
    if chosen.peer == "only":
        changes["parts"] = ()
    base = bench_shadows.QUICK if chosen.quick else bench_shadows.Settings()
    settings = dataclasses.replace(base, **{k: v for k, v in changes.items() if v is not None})  # type: ignore[arg-type]
    begin, said = time.monotonic(), ""

    def tell(fraction: float, text: str) -> None:
        nonlocal said
        first = text.split(",")[0]
        if first != said:
            said = first
            print(f"{time.monotonic() - begin:6.1f} s  {100 * fraction:3.0f} %  {text}", file=sys.stderr, flush=True)

    # The peer first: a run that is stopped has it, and then whatever was measured of ours is kept row by row.
    peer = None if chosen.peer == "none" else peer_pygfx.measure(settings, progress=lambda text: tell(0.0, text))
    if peer and chosen.out:
        chosen.out = Path(chosen.out)
        chosen.out.mkdir(parents=True, exist_ok=True)
        (chosen.out / "peer.json").write_text(json.dumps(peer, indent=1) + "\n", encoding="utf-8")
    with Gpu() as gpu:
        found = bench_shadows.shadows(gpu, chosen.out, settings=settings, fresh=chosen.fresh, progress=tell)
    document = found.to_json()
    if peer:
        document["peer"] = peer
    document["seconds"] = round(time.monotonic() - begin, 1)
    whole = ShadowBench(document, found.notes)
    if chosen.out:
        whole.save(chosen.out)
    print(json.dumps(document, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
