"""Reflection techniques: what polished and clear materials show of their surroundings."""

from tyndall.techniques.contract import Technique
from tyndall.techniques.reflection.field_reflections import FieldReflections
from tyndall.techniques.reflection.none import NoReflections

MEMBERS: tuple[type[Technique], ...] = (NoReflections, FieldReflections)
