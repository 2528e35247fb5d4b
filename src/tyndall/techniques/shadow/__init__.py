"""Shadow techniques: each draws what it needs and provides ``visibility(light, position, normal)``."""

from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow.blurred import Blurred
from tyndall.techniques.shadow.esm import Esm
from tyndall.techniques.shadow.evsm import Evsm
from tyndall.techniques.shadow.field import FieldShadows
from tyndall.techniques.shadow.pcf import Pcf
from tyndall.techniques.shadow.pcss import Pcss
from tyndall.techniques.shadow.penumbra_wedge import PenumbraWedge
from tyndall.techniques.shadow.planar import Planar
from tyndall.techniques.shadow.projective import Projective
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.shadow.shadow_volume import ShadowVolume
from tyndall.techniques.shadow.vsm import Vsm

MEMBERS: tuple[type[Technique], ...] = (
    ShadowMap,
    Pcf,
    Pcss,
    Vsm,
    Esm,
    Evsm,
    Blurred,
    ShadowVolume,
    PenumbraWedge,
    Planar,
    Projective,
    RayTraced,
    FieldShadows,
)
