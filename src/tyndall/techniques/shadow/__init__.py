"""Shadow techniques: each draws what it needs and provides ``visibility(light, position, normal)``."""

from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow.pcf import Pcf
from tyndall.techniques.shadow.pcss import Pcss
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.shadow.shadow_volume import ShadowVolume

MEMBERS: tuple[type[Technique], ...] = (ShadowMap, Pcf, Pcss, ShadowVolume, RayTraced)
