"""Occlusion techniques: how much of the ambient light reaches a surface."""

from tyndall.techniques.contract import Technique
from tyndall.techniques.occlusion.field_ao import FieldAo
from tyndall.techniques.occlusion.none import NoOcclusion
from tyndall.techniques.occlusion.ray_traced_ao import RayTracedAo

MEMBERS: tuple[type[Technique], ...] = (NoOcclusion, RayTracedAo, FieldAo)
