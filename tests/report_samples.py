"""Folders as ``tyndall compare`` saves them, made by hand: a beam in a room, by techniques with known errors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.lab.metrics import bias, rel_rmse
from tyndall.lab.picture import Picture, write_layers

SIZE = (96, 54)
SCENE = "<script>alert('box')</script> & “quotes”"
EXPOSURE = 1.0
# Label, the factor that its light in the air has, and its GPU time in ms; "off" draws none.
TECHNIQUES = (("off", 0.0, 0.001), ("coarse", 0.5, 0.1), ("fine", 0.98, 0.4), ("slow", 0.9, 3.0))

Light = NDArray[np.float32]


def room(size: tuple[int, int]) -> tuple[Light, Light]:
    """Light of the surfaces and of the air, (H, W, 3) each."""
    width, height = size
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    wall = 0.02 + 0.05 * y[..., None] * np.array([1.0, 0.8, 0.6])
    wall[(x - 0.5) ** 2 + (y - 0.7) ** 2 < 0.02] = (0.3, 0.05, 0.02)
    beam = np.where(np.abs(x - 0.3 - 0.4 * y) < 0.1, 0.4, 0.0)[..., None] * np.array([1.0, 0.95, 0.8])
    return wall.astype(np.float32), beam.astype(np.float32)


def developed(radiance: Light, exposure: float = EXPOSURE) -> NDArray[np.uint8]:
    """Bytes by Hill's fit of ACES, as tonemap.wesl has it, without dither."""
    into = [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
    out = [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
    v = (radiance.astype(np.float64) * 2**exposure) @ np.transpose(into)
    fitted = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    x = np.clip(fitted @ np.transpose(out), 0, 1)
    srgb = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)
    return np.rint(255 * srgb).astype(np.uint8)


def save_comparison(
    folder: Path, scene: str = SCENE, *, noise: float = 0.01, size: tuple[int, int] = SIZE
) -> dict[str, Any]:
    """Write a folder with every key and file of today; returns what ``results.json`` holds."""
    folder.mkdir(parents=True)
    wall, beam = room(size)
    truth = wall + beam
    depth = np.full(truth.shape[:2], 3.0, np.float32)
    error = np.full_like(beam, noise * beam.mean())
    Picture(developed(truth), truth, depth).save(folder / "reference.png")
    write_layers(folder / "reference.exr", {"": truth, "inscatter": beam, "inscatter_error": error}, depth)
    results = []
    for label, factor, ms in TECHNIQUES:
        air = factor * beam
        picture = Picture(developed(wall + air), wall + air, depth)
        picture.save(folder / f"{label}.png")
        picture.save(folder / f"{label}.exr")
        write_layers(folder / f"{label}-still.exr", {"": wall + air, "inscatter": air}, depth)
        kinds = {"inscattered": (air, beam), "radiance": (wall + air, truth)}
        results.append(
            {
                "label": label,
                "technique": label,
                "model": None,
                "up_to_scale": label == "coarse",
                "gpu_ms": {"median": ms, "min": 0.9 * ms, "p95": 1.2 * ms},
                "frame_ms": ms + 0.5,
                "host_ms": 0.6,
                "passes": {
                    f"volumetric.{label}.scatter": 0.7 * ms,
                    f"volumetric.{label}.apply": 0.3 * ms,
                    "lighting": 0.5,
                    "frame": ms + 0.5,
                },
                "memory_bytes": int(1e6 * ms),
                "memory": {f"volumetric.{label}": int(1e6 * ms), "frame": 1_000_000},
                "errors": {
                    kind: {
                        "rmse": (rel_rmse(x, r) or 0) * float(r.mean()),
                        "rel_rmse": rel_rmse(x, r),
                        "rel_rmse_corrected": rel_rmse(x, r),
                        "rel_rmse_limit": 0.05,
                        "within_noise": False,
                        "bias": bias(x, r),
                        "psnr": 30.0 + 10 * factor,
                        "ssim": 0.5 + factor / 2,
                        "flip": 0.3 * (1 - factor),
                        "boundary": None,
                        "scaled_rel_rmse": 0.001,
                        "best_scale": 1 / factor if factor else 0.0,
                    }
                    for kind, (x, r) in kinds.items()
                },
                "error": {"rel_rmse": rel_rmse(air, beam), "bias": bias(air, beam), "psnr": 40.0},
                "image": f"{label}.png",
                "exr": f"{label}.exr",
                "still_exr": f"{label}-still.exr",
            }
        )  # fmt: skip
    document = {
        "adapter": "a device <b>of tests</b>",
        "scene": scene,
        "triangles": 4968,
        "size": list(size),
        "family": "volumetric",
        "exposure": EXPOSURE,
        "results": results,
        "reference": {
            "judge": "traced",
            "samples": 512,
            "seconds": 3.25,
            "relative_error": {"inscattered": noise, "radiance": noise / 2},
            "settings": {"target": 0.01, "depth": 2},
            "image": "reference.png",
            "exr": "reference.exr",
            "still_exr": "reference.exr",
        },
        "versions": {"tyndall": "0.1.0", "wgpu": "0.32.0"},
        "driver": "a driver",
        "parameters": {
            "volumetric": {label: {"technique": label, "steps": 64} for label, _, _ in TECHNIQUES},
            "tonemap": {"technique": "aces", "dither": 0.0},
            "seed": 0,
        },
        "scene_hash": "0123456789abcdef" * 4,
        "command": "tyndall compare 'a & b.glb' --truth traced --report",
    }
    (folder / "results.json").write_text(json.dumps(document), encoding="utf-8")
    return document


def save_old_comparison(folder: Path) -> dict[str, Any]:
    """The same as a version before wrote it: without labels, errors of all kinds, exposure, and still frames."""
    document = save_comparison(folder, "old")
    for key in ("family", "exposure", "command"):
        del document[key]
    for result in document["results"]:
        for key in ("label", "up_to_scale", "host_ms", "passes", "memory", "errors", "exr", "still_exr"):
            del result[key]
        (folder / f"{result['technique']}-still.exr").unlink()
    document["reference"] = {"technique": "march", "steps": 1024, "converged": True, "mean": 0.02}
    (folder / "results.json").write_text(json.dumps(document), encoding="utf-8")
    return document


def save_sweep(folder: Path) -> list[dict[str, Any]]:
    """Write a sweep of two scenes, two techniques and three numbers of lights; returns its rows."""
    rows = []
    for scene in ("box", "blinds"):
        for technique, factor in (("froxel", 1.0), ("march", 3.0)):
            for lights in (1, 2, 8):
                point = {"scene": scene, "lights": lights, "size": [96, 54], "technique": {"technique": technique}}
                errors = {"inscattered": {"rel_rmse_corrected": 0.3 / factor, "rel_rmse": 0.31 / factor}}
                rows.append(
                    {
                        "id": f"{scene}-{technique}-{lights}",
                        "status": "done",
                        "point": point,
                        "gpu_ms": {"median": factor * lights, "min": factor, "p95": 2 * factor * lights},
                        "memory_bytes": 1_000_000,
                        "errors": errors,
                    }
                )
    folder.mkdir(parents=True)
    (folder / "results.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    return rows
