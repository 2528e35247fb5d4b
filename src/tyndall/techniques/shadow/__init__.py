"""Shadow techniques: each draws what it needs and provides ``visibility(light, position, normal)``."""

from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow.blurred import Blurred
from tyndall.techniques.shadow.penumbra_wedge import PenumbraWedge
from tyndall.techniques.shadow.planar import Planar
from tyndall.techniques.shadow.projective import Projective
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.shadow.shadow_volume import ShadowVolume

MEMBERS: tuple[type[Technique], ...] = (
    ShadowMap,
    Blurred,
    ShadowVolume,
    PenumbraWedge,
    Planar,
    Projective,
    RayTraced,
)
