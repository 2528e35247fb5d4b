"""The pictures of a comparison as they go into the page: light, thumbnails, maps of the error, crops."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tyndall.lab import metrics
from tyndall.lab.closeup import Place, worst_places
from tyndall.lab.picture import OutputError
from tyndall.lab.report import light as codec
from tyndall.lab.report.heat import Scale, encode_map
from tyndall.lab.report.results import Study
from tyndall.lab.report.verdict import BASELINE, main_metric

TRUTH = "truth"
MOST_BYTES = 36_000_000  # of pictures in one page: six of 1920×1080 fit
_LAYERS = {"inscattered": "inscatter", "surfaces": "surfaces", "radiance": ""}  # in EXR files


@dataclass(frozen=True)
class Maps:
    """Error maps of one kind of light: PNGs as URIs by technique, and what their colours mean."""

    scale: Scale
    uris: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Images:
    """Everything drawn.

    Attributes:
        size: width and height of all pictures here, which may be smaller than they were rendered.
        keys: names of the pictures: truth first, if there is one, then each technique with a picture.
        opening: which two of them are shown first.
        uris: each picture in 8 bits.
        light: each in linear light (:func:`~tyndall.lab.report.light.encode_light`); empty where there is none.
        maps: by kind of light.
        crops: places, and for each the crops of all pictures.
        patch: size of a crop in pixels.
        notes: what a reader must know about them.
    """

    size: tuple[int, int]
    keys: list[str]
    opening: tuple[int, int]
    uris: list[str]
    light: list[bytes]
    maps: Mapping[str, Maps]
    crops: list[tuple[Place, list[str]]]
    patch: tuple[int, int]
    notes: list[str]


def images(study: Study, most_bytes: int = MOST_BYTES) -> Images:
    """Read and encode the pictures of a comparison.

    Args:
        most_bytes: about how much of the page they may take; larger ones are shown smaller, and the notes say so.

    Raises:
        OutputError: one line; a picture is missing, cannot be read, or is of another size than the others.
    """
    pictures, radiance = _pictures(study)
    errors = _error_maps(study)
    notes = []
    if not radiance:
        notes.append("Pictures are shown in 8 bits, as saved: these results do not hold what an exposure needs.")
    factor = 1
    while True:
        shown = {key: codec.shrink(p, factor) for key, p in pictures.items()}
        light = [codec.encode_light(codec.shrink(r, factor)) for r in radiance.values()]
        maps = {kind: _encode_maps(m, factor) for kind, m in errors.items()}
        uris = [_uri(codec.encode_image(p, lossless=not radiance), "webp") for p in shown.values()]
        total = sum(map(len, uris)) + sum(len(u) for m in maps.values() for u in m.uris.values())
        total += sum(4 * len(part) // 3 for part in light)
        if total <= most_bytes or min(next(iter(shown.values())).shape[:2]) < 64:
            break
        factor *= 2
    height, width = next(iter(shown.values())).shape[:2]
    if factor > 1:
        notes.append(f"To keep this page light, pictures are shown at 1/{factor} of their size: {width}×{height}.")
    places, patch = _places(study, errors, (width, height), factor)
    crops = [
        (place, [_uri(codec.encode_image(place.crop(p), lossless=True), "webp") for p in shown.values()])
        for place in places
    ]
    return Images(
        size=(width, height),
        keys=list(shown),
        opening=_opening(study, list(shown)),
        uris=uris,
        light=light,
        maps=maps,
        crops=crops,
        patch=patch,
        notes=notes,
    )


def _pictures(study: Study) -> tuple[dict[str, NDArray[np.uint8]], dict[str, NDArray[np.float32]]]:
    """8-bit pictures by key, and their light; no light unless it is there for all, and the exposure too."""
    named: dict[str, tuple[str, str | None]] = {}
    if study.reference and study.reference.image:
        named[TRUTH] = (study.reference.image, study.reference.exr)
    named |= {r.label: (r.image, r.exr) for r in study.results if r.image}
    if not named:
        raise OutputError(f"{study.folder}: results.json names no pictures")
    pictures = {key: codec.read_image(study.place(image)) for key, (image, _) in named.items()}
    radiance: dict[str, NDArray[np.float32]] = {}
    if study.exposure is not None and all(exr for _, exr in named.values()):
        for key, (_, exr) in named.items():
            path = study.place(str(exr))
            colour = codec.layer(codec.read_exr(path), "", path)
            if colour is None:
                raise OutputError(f"{path}: has no channels R, G, B")
            radiance[key] = colour
    for key, (image, exr) in named.items():
        for name, pixels in ((image, pictures[key]), (exr, radiance.get(key))):
            if pixels is not None:
                _check_size(study, study.place(str(name)), pixels)
    return pictures, radiance


def _error_maps(study: Study) -> dict[str, dict[str, NDArray[np.float32]]]:
    """(H, W) by kind of light and technique (:func:`tyndall.lab.metrics.error_map`); "truth" is its standard error.

    The frames that errors were measured on are used where they were saved; else the antialiased ones.
    """
    truth = study.reference
    name = (truth.still_exr or truth.exr) if truth else None
    if name is None:
        return {}
    path = study.place(name)
    reference = codec.read_exr(path)
    stills = [(r.label, study.place(name)) for r in study.results if (name := r.still_exr or r.exr)]
    channels = [(label, source, codec.read_exr(source)) for label, source in stills]
    found: dict[str, dict[str, NDArray[np.float32]]] = {}
    for kind in dict.fromkeys([*study.kinds, "radiance"]):
        if kind not in _LAYERS:
            continue
        target = codec.layer(reference, _LAYERS[kind], path)
        if target is None:
            continue
        _check_size(study, path, target)
        for label, source, layers in channels:
            image = codec.layer(layers, _LAYERS[kind], source)
            if image is not None:
                _check_size(study, source, image)
                found.setdefault(kind, {})[label] = metrics.error_map(image, target)
        noise = codec.layer(reference, f"{_LAYERS[kind] or 'radiance'}_error", path)
        if noise is not None and noise.any() and kind in found:
            found[kind][TRUTH] = metrics.error_map(target + noise, target)
    return found


def _check_size(study: Study, path: Path, pixels: NDArray[np.generic]) -> None:
    height, width = pixels.shape[:2]
    if (width, height) != tuple(study.size):
        raise OutputError(f"{path}: is {width}×{height}, and results.json says {study.size[0]}×{study.size[1]}")


def _encode_maps(errors: Mapping[str, NDArray[np.float32]], factor: int) -> Maps:
    smaller = {label: codec.shrink(m, factor, power=2) for label, m in errors.items()}
    scale = Scale.over(m for label, m in smaller.items() if label != TRUTH)
    return Maps(scale, {label: _uri(encode_map(m, scale), "png") for label, m in smaller.items()})


def _places(
    study: Study, errors: Mapping[str, Mapping[str, NDArray[np.float32]]], size: tuple[int, int], factor: int
) -> tuple[list[Place], tuple[int, int]]:
    """Where the field is worst, every technique having an equal say; the middle where there are no errors."""
    width, height = size
    baseline = {r.label for r in study.results if r.technique == BASELINE}
    first = next(iter(errors.values()), {})
    field = np.zeros((height, width))
    for label, error in first.items():
        square = codec.shrink(error, factor, power=2).astype(np.float64) ** 2
        if label not in baseline and label != TRUTH and square.any():
            field += square / square.mean()
    places = worst_places(np.sqrt(field).astype(np.float32), 3)
    patch = (min(width, max(16, width // 8)), min(height, max(12, 3 * width // 32)))
    if not places:
        places = [Place((width - patch[0]) // 2, (height - patch[1]) // 2, *patch)]
    return places, patch


def _opening(study: Study, keys: list[str]) -> tuple[int, int]:
    """The technique with the largest error against the truth: there is most to see."""
    techniques = [r.label for r in study.results if r.technique != BASELINE and r.label in keys]
    judged = main_metric(study)
    if judged:
        errors = {r.label: r.errors.get(judged[0], {}).get(judged[1]) or 0.0 for r in study.results}
        techniques.sort(key=errors.__getitem__, reverse=True)
    first = keys.index(techniques[0]) if techniques else 0
    second = keys.index(TRUTH) if TRUTH in keys else min(len(keys) - 1, first + 1)
    return first, second


def _uri(content: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"
