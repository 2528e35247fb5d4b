"""Shadow techniques: each draws what it needs and provides ``visibility(light, position, normal)``."""

from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow.penumbra_wedge import PenumbraWedge
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.shadow.shadow_volume import ShadowVolume

MEMBERS: tuple[type[Technique], ...] = (ShadowMap, ShadowVolume, PenumbraWedge, RayTraced)
