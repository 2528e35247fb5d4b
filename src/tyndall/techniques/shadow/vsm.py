"""Variance shadow maps (Donnelly and Lauritzen 2006).

The mean and the mean square of the depth around a place give its variance, and Chebyshev's inequality bounds the part
of the texels that lie beyond the place: ``V ≤ σ²/(σ² + (z − μ)²)`` where ``z > μ``, 1 else. For one flat caster over
one flat receiver the bound is the answer. Where casters overlap at different depths it is not, and light bleeds into
the shadow; ``bleeding`` cuts off what is below it and makes edges harder for that.

Unlike in the paper the variance is not raised by the slope of the receiver: the same bias as a shadow map's moves the
place towards the light. Depths are kept relative to the middle of the map's reach, which spares two bits of the square.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.gpu.params import param
from tyndall.techniques.shadow.moment_maps import MomentMaps


@dataclass(frozen=True)
class Vsm(MomentMaps):
    """Two moments of the depth, blurred."""

    name: ClassVar[str] = "vsm"
    paper: ClassVar[str] = "Donnelly and Lauritzen 2006, Variance shadow maps"
    advice: ClassVar[str] = "Wide smooth edges at a cost that no radius raises; light bleeds where casters overlap."
    format: ClassVar[str] = "rg32float"

    bleeding: float = param(0.2, 0, 0.99, "visibility below which a place is dark")
    min_deviation: float = param(0.25, 0, 16, "least standard deviation of the depth", unit="texel")
