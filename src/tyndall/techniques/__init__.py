"""Interchangeable ways to do one job, a family a folder. A technique is listed in its family's ``MEMBERS``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tyndall.gpu.params import ParameterError, fields_of, nearest, replace
from tyndall.techniques import antialiasing, occlusion, reflection, shadow, tonemap, volume, volumetric
from tyndall.techniques.contract import Technique


@dataclass(frozen=True)
class Family:
    """Techniques that can stand in for each other.

    Attributes:
        name: of the folder.
        members: technique classes by name.
        default: name of the one that is used when none is asked for.
    """

    name: str
    members: Mapping[str, type[Technique]]
    default: str

    def find(self, name: str) -> type[Technique]:
        """The technique of that name.

        Raises:
            ParameterError: there is none; the nearest one is named.
        """
        if name not in self.members:
            known = ", ".join(self.members)
            raise ParameterError(f"no {self.name} technique '{name}'{nearest(name, self.members)} (there are {known})")
        return self.members[name]

    def make(
        self,
        technique: str | Technique | None = None,
        looks: Mapping[str, Mapping[str, Any]] | None = None,
        changes: Mapping[str, Any] | None = None,
    ) -> Technique:
        """A technique by name (the default one for None), or the instance given.

        Args:
            looks: a scene's own parameters by technique name; they are starting values of one made by name.
            changes: parameters by name, values as texts or of their type.

        Raises:
            ParameterError: an unknown name, what is no technique, or a value outside its range.
        """
        if isinstance(technique, Technique):
            if type(technique) not in self.members.values():
                raise ParameterError(f"{technique.name} is not a {self.name} technique")
            made = technique
        elif technique is not None and not isinstance(technique, str):
            raise ParameterError(f"{technique!r} is neither a {self.name} technique nor the name of one")
        else:
            cls = self.find(technique or self.default)
            made = replace(cls(), (looks or {}).get(cls.name, {}))
        return replace(made, changes) if changes else made


def _family(name: str, module: Any, default: str) -> Family:
    return Family(name, {member.name: member for member in module.MEMBERS}, default)


FAMILIES: dict[str, Family] = {
    family.name: family
    for family in (
        _family("shadow", shadow, "shadow_map"),
        _family("volumetric", volumetric, "froxel"),
        _family("occlusion", occlusion, "none"),
        _family("reflection", reflection, "field_reflections"),
        _family("volume", volume, "uniform_march"),
        _family("antialiasing", antialiasing, "taa"),
        _family("tonemap", tonemap, "aces"),
    )
}

__all__ = ["FAMILIES", "Family", "Technique", "fields_of"]
