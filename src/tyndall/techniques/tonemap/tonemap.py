"""Tone mapping, then sRGB encoding (IEC 61966-2-1) with a half-byte dither that hides banding.

``aces`` is the fitted reference and output transform of Hill 2016 (RRT+ODT), ``agx`` Sobotka's AgX in the polynomial
form of Wrensch 2023, ``none`` clips. The camera's exposure is applied before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.gpu.params import param
from tyndall.gpu.resources import Texture
from tyndall.techniques.contract import Technique, View


class _Curve(Technique):
    def render(self, view: View, image: Texture, target: Texture) -> None:
        """Write the picture of ``image`` into ``target`` (rgba8unorm)."""
        view.compute(self.name).bind(image=image, picture_out=target.write()).dispatch(*view.size)


@dataclass(frozen=True)
class Aces(_Curve):
    """Filmic, contrasty; bright colours go to white."""

    name: ClassVar[str] = "aces"
    paper: ClassVar[str] = "Academy Color Encoding System; fit by Hill 2016"
    advice: ClassVar[str] = "The default look of films and games."

    dither: float = param(0.5, 0, 4, "amplitude of the dither", unit="1/255")


@dataclass(frozen=True)
class Agx(_Curve):
    """Softer than ACES; saturated lights keep their hue."""

    name: ClassVar[str] = "agx"
    paper: ClassVar[str] = "Sobotka 2022, AgX; polynomial by Wrensch 2023"
    advice: ClassVar[str] = "For scenes with very bright coloured lights; Blender's default."

    dither: float = param(0.5, 0, 4, "amplitude of the dither", unit="1/255")


@dataclass(frozen=True)
class Clip(_Curve):
    """Values above 1 are cut off."""

    name: ClassVar[str] = "none"
    paper: ClassVar[str] = "none"
    advice: ClassVar[str] = "To read numbers off a picture: 1.0 is 255, below it only the sRGB curve acts."

    dither: float = param(0.0, 0, 4, "amplitude of the dither", unit="1/255")
