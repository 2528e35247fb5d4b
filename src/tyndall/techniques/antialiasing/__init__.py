"""Antialiasing techniques."""

from tyndall.techniques.antialiasing.none import NoAntialiasing
from tyndall.techniques.antialiasing.taa import Taa
from tyndall.techniques.contract import Technique

MEMBERS: tuple[type[Technique], ...] = (NoAntialiasing, Taa)
