"""Solid primitives; ``solids.wesl`` has each for the device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tyndall.gpu.params import param
from tyndall.sdf.shape import Box, Floats, Primitive, Vec3


def centred(half: Floats) -> Box:
    """The box of these half sides around 0."""
    return -half, half.copy()


@dataclass(frozen=True)
class Sphere(Primitive):
    """|p| − r."""

    code: ClassVar[str] = "sphere"
    radius: float = param(1.0, 1e-6, None, "radius", unit="m")

    def distance(self, p: Floats) -> Floats:
        return np.linalg.norm(p, axis=1) - self.radius

    def extent(self, level: float) -> Box:
        return centred(np.full(3, self.radius + level))


@dataclass(frozen=True)
class Cuboid(Primitive):
    """A box around 0 (Quilez)."""

    code: ClassVar[str] = "cuboid"
    size: Vec3 = param((1.0, 1.0, 1.0), 1e-6, None, "whole sides", unit="m")

    def distance(self, p: Floats) -> Floats:
        q = np.abs(p) - 0.5 * np.array(self.size)
        return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)

    def extent(self, level: float) -> Box:
        return centred(0.5 * np.array(self.size) + level)


def sphere(radius: float = 1.0) -> Sphere:
    """A sphere around 0; see :class:`Sphere`."""
    return Sphere(radius)


def box(size: float | Vec3 = 1.0) -> Cuboid:
    """A box around 0 with whole sides ``size``, or a cube; see :class:`Cuboid`."""
    return Cuboid((size, size, size) if isinstance(size, (int, float)) else size)
