"""What S4 published: the frame rates of its three tables, and what its chapter 4 says of each technique.

S4 is a *comparison of shadow techniques* (2013), a thesis in Portuguese whose program draws with Direct3D 11 at
800×600; it does not say on which machine. Its *shadow maps*, *perspective shadows* and *shadow volumes* are this
project's ``shadow_map``, ``projective`` and ``shadow_volume`` by z-pass. Frames per second are means of running
programs, so its host's time is in them.
"""

from __future__ import annotations

from collections.abc import Mapping

SIZE = (800, 600)
TRIANGLES = (10, 100, 1_000, 10_000, 100_000)
LIGHTS = (1, 2, 3, 4, 5)

FPS: Mapping[str, tuple[tuple[int, ...], ...]] = {
    "shadow_map": (
        (730, 655, 563, 452, 350),
        (728, 642, 560, 445, 338),
        (725, 625, 554, 439, 333),
        (697, 617, 514, 385, 305),
        (513, 415, 328, 235, 112),
    ),
    "projective": (
        (780, 662, 608, 442, 306),
        (768, 645, 592, 421, 284),
        (744, 630, 566, 404, 265),
        (709, 626, 520, 362, 231),
        (580, 430, 342, 207, 97),
    ),
    "shadow_volume": (
        (1020, 904, 485, 366, 256),
        (980, 883, 455, 302, 222),
        (906, 765, 364, 284, 189),
        (842, 694, 482, 238, 134),
        (754, 607, 398, 167, 75),
    ),
}
"""Frames per second by this project's name of the technique; a row for each of :data:`TRIANGLES`, a column for each of
:data:`LIGHTS`."""

NAMES: Mapping[str, str] = {
    "shadow_map": "shadow maps",
    "projective": "perspective shadows",
    "shadow_volume": "shadow volumes",
}
"""S4's own names."""


def fps(technique: str, triangles: int, lights: int) -> int | None:
    """What S4 gives for a technique, or None where it gives nothing. Its shadow volumes are "shadow_volume/zpass"; maps
    are maps, whatever draws them.
    """
    name, _, choice = technique.partition("/")
    if name not in FPS or choice not in ("", "zpass", "compute") or triangles not in TRIANGLES or lights not in LIGHTS:
        return None
    return FPS[name][TRIANGLES.index(triangles)][LIGHTS.index(lights)]
