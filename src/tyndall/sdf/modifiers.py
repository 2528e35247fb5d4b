"""What is done to one shape: to the places that it is asked at, or to its value; ``modifiers.wesl`` has each for the
device.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from tyndall.gpu.params import param
from tyndall.sdf.shape import Accuracy, Box, Floats, Modifier, Shape


@dataclass(frozen=True)
class Round(Modifier):
    """The surface moved outwards: d − r."""

    code: ClassVar[str] = "round"
    adjusts: ClassVar[bool] = True
    shape: Shape
    radius: float = param(0.1, 0, None, "by how much", unit="m")

    def leave(self, d: Floats, p: Floats) -> Floats:
        return d - self.radius

    def extent(self, level: float) -> Box:
        return self.shape.extent(level + self.radius)

    @cached_property
    def accuracy(self) -> Accuracy:
        return self.shape.accuracy
