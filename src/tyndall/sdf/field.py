"""Stand-in for the objects on the device: spheres only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tyndall.gpu.device import Gpu
from tyndall.gpu.resources import Bound, Closing, Resource
from tyndall.scene.model import Implicit

_OBJECT = "package::sdf::march::Object"


class Field(Closing):
    """Spheres."""

    def __init__(self, gpu: Gpu, implicits: Sequence[Implicit]) -> None:
        self._gpu = gpu
        self._rows = np.zeros(max(1, len(implicits)), gpu.dtype(_OBJECT))
        for row, one in zip(self._rows, implicits, strict=False):
            self._put(row, one.transform)
            shape: Any = one.shape
            while shape.children:
                shape = shape.children[0]
            row["radius"] = shape.numbers[0]
            row["base_color"], row["metallic"] = one.material.base_color[:3], one.material.metallic
            row["emissive"], row["roughness"] = one.material.emissive, one.material.roughness
        self._objects = gpu.buffer("sdf.objects", self._rows, owner="sdf", element=_OBJECT)
        self._names = [one.name for one in implicits]
        self.uploaded = self._rows.nbytes
        self._pending = self.uploaded

    @staticmethod
    def _put(row: Any, transform: ArrayLike) -> None:
        matrix = np.asarray(transform, np.float64)
        row["to_object"] = np.linalg.inv(matrix).T
        row["factor"] = np.linalg.svd(matrix[:3, :3], compute_uv=False)[-1]

    @property
    def bindings(self) -> dict[str, Bound]:
        return {"implicit_objects": self._objects.read()}

    def update(self) -> None:
        self.uploaded, self._pending = self._pending, 0

    def place(self, index: int, transform: ArrayLike) -> None:
        self._put(self._rows[index], transform)
        size = self._rows.itemsize
        self._gpu.write(self._objects, self._rows[index : index + 1], index * size)
        self._pending += size

    def move(self, name: str, matrices: ArrayLike) -> None:
        raise NotImplementedError

    def resources(self) -> list[Resource]:
        return [self._objects]

    def close(self) -> None:
        self._objects.destroy()


__all__ = ["Field", "Mapping"]
