"""Directional lights placed by rule, so that a scene can be lit by 1 to 32 of them at a constant exposure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tyndall.gpu.params import check, param
from tyndall.scene.model import DirectionalLight, Vec3

GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True)
class Options:
    """What every bundled scene can be asked for.

    Raises:
        ParameterError: a value that is not a whole number in range.
    """

    lights: int = param(1, 1, 32, "directional lights")
    seed: int = param(0, 0, 2**32 - 1, "seed of everything random: textures, clutter, foliage")

    def __post_init__(self) -> None:
        check(self)


def suns(
    count: int, direction: Vec3, intensity: float, color: Vec3, elevations: tuple[float, float]
) -> tuple[DirectionalLight, ...]:
    """``count`` directional lights that together bring the illuminance of one.

    Light 0 travels along ``direction``. Each further one comes from an azimuth one golden angle (137.5°) beyond the
    last, which spreads any number of them evenly, and from an elevation that walks through the range ``elevations``
    (degrees) in irrational steps; its hue drifts a little from ``color`` to cooler and warmer. Light 0 keeps twice the
    share of the others: ``intensity`` · 2/(count + 1) and ``intensity`` / (count + 1), in lux.
    """
    azimuth = math.atan2(-direction[2], -direction[0])
    low, high = (math.radians(e) for e in elevations)
    lights = [DirectionalLight(direction, intensity * 2 / (count + 1), color)]
    for k in range(1, count):
        turn = azimuth + k * GOLDEN_ANGLE
        elevation = low + (high - low) * ((k * GOLDEN_ANGLE / (2 * math.pi)) * 5 % 1)
        horizontal = math.cos(elevation)
        travel = (-horizontal * math.cos(turn), -math.sin(elevation), -horizontal * math.sin(turn))
        drift = math.sin(2.4 * k)
        hue = np.clip(np.array(color) * (1 + 0.18 * drift, 1, 1 - 0.22 * drift), 0, None)
        lights.append(DirectionalLight(travel, intensity / (count + 1), (float(hue[0]), float(hue[1]), float(hue[2]))))
    return tuple(lights)
