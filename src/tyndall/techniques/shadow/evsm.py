"""Exponential variance shadow maps (Lauritzen and McCool 2008).

A variance shadow map (:mod:`tyndall.techniques.shadow.vsm`) of a warped depth: ``e^(c·z)``, with z from −1 to 1,
spreads what is near the receiver and presses together what is far before it, so that overlapping casters are one to
Chebyshev's inequality and hardly bleed. A second bound, of ``−e^(−c·z)``, is loose where the first is tight; the
smaller of both is taken. Four moments a texel are kept.

Squares of the exponential must fit a 32-bit float, which holds c below 44; ``positive`` and ``negative`` end at 42. The
least variance is given in texels of depth and warped with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.gpu.params import param
from tyndall.techniques.shadow.moment_maps import MomentMaps


@dataclass(frozen=True)
class Evsm(MomentMaps):
    """Two moments of each of two exponentials of the depth, blurred."""

    name: ClassVar[str] = "evsm"
    paper: ClassVar[str] = "Lauritzen and McCool 2008, Layered variance shadow maps"
    advice: ClassVar[str] = (
        "Wide smooth edges at a cost that no radius raises, nearly without bleeding; 16 bytes a texel, twice."
    )
    format: ClassVar[str] = "rgba32float"

    positive: float = param(40.0, 0.1, 42, "c of the warp that grows with the depth")
    negative: float = param(10.0, 0.1, 42, "c of the warp that falls with it")
    bleeding: float = param(0.1, 0, 0.99, "visibility below which a place is dark")
    min_deviation: float = param(0.25, 0, 16, "least standard deviation of the depth", unit="texel")
