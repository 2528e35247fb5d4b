"""Exponential shadow maps (Annen, Mertens, Seidel, Flerackers and Kautz 2008; Salvi 2008).

Where the light is blocked at depth ``b`` before a place at ``z``, ``e^(−c·(z − b))`` falls from 1 to 0 the faster the
larger ``c`` is; and it is a product of a part for the place and one for the texel, ``e^(−c·z)·e^(c·b)``, so that the
latter may be blurred: ``V = min(1, e^(−c·z)·mean e^(c·b))``. One number a texel is kept. Close behind a caster, within
about ``1/c``, its shadow is too light; and where a blur reaches past an edge to something far behind the place, too.

``c`` is per metre of the map's reach: ``exponent`` over the reach. The paper's c is limited to 88 by the range of a
32-bit float. Here the *logarithm* of the mean is kept, ``ln(mean e^(c·b))/c``, a depth again, and every sum is taken
relative to its largest term, so that any ``c`` does. Interpolation between texels is of the exponentials, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.gpu.params import param
from tyndall.techniques.shadow.moment_maps import MomentMaps


@dataclass(frozen=True)
class Esm(MomentMaps):
    """The exponential of the depth, blurred."""

    name: ClassVar[str] = "esm"
    paper: ClassVar[str] = "Annen et al. 2008, Exponential shadow maps"
    advice: ClassVar[str] = (
        "Smooth edges from one number a texel, with little bleeding; shadows fade near their casters."
    )
    format: ClassVar[str] = "r32float"

    exponent: float = param(1000.0, 1, 20_000, "darkening: e-fold over this part of the map's reach")
