"""Volumetric techniques: in-scattered light ``L_v`` and transmittance ``T`` of every pixel."""

from tyndall.techniques.contract import Technique
from tyndall.techniques.volumetric.froxel import Froxel
from tyndall.techniques.volumetric.march import March
from tyndall.techniques.volumetric.off import Off
from tyndall.techniques.volumetric.polygonal import Polygonal
from tyndall.techniques.volumetric.screen_space import ScreenSpace

MEMBERS: tuple[type[Technique], ...] = (Off, ScreenSpace, Polygonal, Froxel, March)
