"""Exponential shadow maps (Annen, Mertens, Seidel, Flerackers and Kautz 2008; Salvi 2008).

Where the light is blocked at depth ``b`` before a place at ``z``, ``e^(−c·(z − b))`` falls from 1 to 0 the faster the
larger ``c`` is; and it is a product of a part for the place and one for the texel, ``e^(−c·z)·e^(c·b)``, so that the
latter may be blurred: ``V = min(1, e^(−c·z)·mean e^(c·b))``. One number a texel is kept. Close behind a caster, within
about ``1/c``, its shadow is too light; and where a blur reaches past an edge to something far behind the place, too.

``c`` is ``exponent`` over a texel's width (half-way through a perspective map's reach), so that the shadow is as dark
so many texels behind a caster at any scale. The paper's c over the whole reach is limited to 88 by the range of a
32-bit float. Here the *logarithm* of the mean is kept, ``ln(mean e^(c·b))/c``, a depth again, and every sum is taken
relative to its largest term, so that any ``c`` does. Texels are interpolated as exponentials, too.

A plane needs hardly any bias, as the mean of its exponentials is above the exponential of their mean; and bias
multiplies what is lit by ``e^(c·bias)``, which narrows shadows. So the bias is less than a shadow map's.
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

    bias: float = param(0.25, 0, 64, "constant bias towards the light; multiplies what is lit", unit="texel")
    slope_bias: float = param(0.25, 0, 64, "bias towards the light for a slope of 1, likewise", unit="texel")
    normal_offset: float = param(0.0, 0, 64, "offset along the normal at grazing light, likewise", unit="texel")
    exponent: float = param(0.5, 0.01, 16, "behind a caster light falls by e to this with every texel", unit="1/texel")
