"""Directional lights placed by rule, so that a scene can be lit by 1 to 32 of them at a constant exposure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tyndall.gpu.params import check, param
from tyndall.scene.model import DirectionalLight, Vec3

GOLDEN_RATIO = (math.sqrt(5) - 1) / 2


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
    count: int,
    direction: Vec3,
    intensity: float,
    color: Vec3,
    elevations: tuple[float, float],
    spread: float = 360.0,
) -> tuple[DirectionalLight, ...]:
    """``count`` directional lights that together bring the illuminance of one.

    Light 0 travels along ``direction``. The azimuths of the others follow the golden-ratio sequence in a sector of
    ``spread`` degrees centred on light 0, which fills it evenly for any count; their elevations walk through the range
    ``elevations`` (degrees) in irrational steps, and their hue drifts a little from ``color`` to cooler and warmer.
    Light 0 keeps twice the share of the others: ``intensity`` · 2/(count + 1) and ``intensity`` / (count + 1), in lux.
    """
    azimuth = math.atan2(-direction[2], -direction[0])
    low, high = (math.radians(e) for e in elevations)
    lights = [DirectionalLight(direction, intensity * 2 / (count + 1), color)]
    for k in range(1, count):
        turn = azimuth + math.radians(spread) * ((k * GOLDEN_RATIO + 0.5) % 1 - 0.5)
        elevation = low + (high - low) * (k * math.sqrt(3) % 1)
        horizontal = math.cos(elevation)
        travel = (-horizontal * math.cos(turn), -math.sin(elevation), -horizontal * math.sin(turn))
        drift = math.sin(2.4 * k)
        red, green, blue = color
        hue = (red * (1 + 0.18 * drift), green, blue * (1 - 0.22 * drift))
        lights.append(DirectionalLight(travel, intensity / (count + 1), hue))
    return tuple(lights)
