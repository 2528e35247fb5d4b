"""Tone mapping: linear light to the bytes of a picture."""

from tyndall.techniques.contract import Technique
from tyndall.techniques.tonemap.tonemap import Aces, Agx, Clip

MEMBERS: tuple[type[Technique], ...] = (Aces, Agx, Clip)
