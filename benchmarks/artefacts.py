"""What the techniques get wrong, close up: the pictures beside S1's figures 26, 27, 29 and 30, in one JPEG.

    python benchmarks/artefacts.py [--size 1280x720] [--out docs/images/artefacts.jpg]

Each pair of rows is a view and the part of it where a technique's light is farthest from the traced truth: the truth,
the technique, and where the error is (see lab/closeup.py).
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import tyndall as ty
from tyndall.gpu.device import Gpu

ROWS = (("box", "screen_space"), ("courtyard", "screen_space"), ("blinds", "polygonal"), ("blinds", "froxel"))
GAP, LABEL, WIDTH = 8, 26, 1104


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--out", type=Path, default=Path("docs/images/artefacts.jpg"))
    parser.add_argument("--scenes", default="box,courtyard,blinds")
    parser.add_argument("--quality", type=int, default=85)
    chosen = parser.parse_args()
    width, height = (int(side) for side in chosen.size.split("x"))
    rows = [row for row in ROWS if row[0] in chosen.scenes.split(",")]
    strips = {}
    with Gpu() as gpu, tempfile.TemporaryDirectory() as folder:
        for name in dict.fromkeys(scene for scene, _ in rows):
            techniques = [technique for scene, technique in rows if scene == name]
            out = Path(folder, name)
            ty.compare(
                ty.scenes.SCENES[name](),
                size=(width, height),
                volumetric=techniques,
                truth_settings=ty.TruthSettings(target=0.01, seconds=20),
                frames=2,
                warmup=0,
                out=out,
                adapter=gpu,
            )
            for technique in techniques:
                strip = Image.open(out / f"{technique}-closeup.png").convert("RGB")
                panel = (strip.width - 4 * GAP) // 3
                tall = LABEL + panel * height // width + panel * 3 // 4 + 3 * GAP  # the view, and the worst place
                strip = strip.crop((0, 0, strip.width, min(tall, strip.height)))
                strips[name, technique] = strip.resize(
                    (WIDTH, strip.height * WIDTH // strip.width), Image.Resampling.LANCZOS
                )
    wide = max(strip.width for strip in strips.values())
    page = np.full((sum(s.height + GAP for s in strips.values()) - GAP, wide, 3), 255, np.uint8)
    top = 0
    for row in rows:
        strip = np.asarray(strips[row])
        page[top : top + strip.shape[0], : strip.shape[1]] = strip
        top += strip.shape[0] + GAP
    Image.fromarray(page).save(chosen.out, quality=chosen.quality, optimize=True)
    print(chosen.out, page.shape)


if __name__ == "__main__":
    main()
