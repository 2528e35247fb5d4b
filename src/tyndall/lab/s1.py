"""What S1 published: the numbers of its tables 1 to 6, and what is known of its figures 20 to 22.

S1 is *Comparison of volumetric-light techniques* (2025), a thesis in Portuguese whose engine, Luz, draws with Vulkan on
an RTX 4060 Laptop beside a Ryzen 9 7940HS. Its scenes are *Bunny Box*, *Classroom* and *San Miguel*; this project's of
the same triangle counts and character are ``box``, ``blinds`` and ``courtyard``, by whose names the numbers are kept.

Its figures are plots without printed numbers. Those of figure 20 are in table 6, as frame rates, which its text says
were made from them. Of figures 21 and 22 the text says that time and memory grow linearly with the lights for every
method, that screen space holds no memory, and that the froxels' volume is one for all lights while the polygonal
method has a map and a mesh a light. What its engine held, :data:`MEMORY`, is from the goals of this project.
"""

from __future__ import annotations

from collections.abc import Mapping

MACHINE = "RTX 4060 Laptop"

SCENES: Mapping[str, tuple[str, int]] = {
    "box": ("Bunny Box", 4_968),
    "blinds": ("Classroom", 607_402),
    "courtyard": ("San Miguel", 5_608_441),
}
"""Table 1: the scene's name there, and its triangles."""

TECHNICAL: Mapping[str, tuple[int, ...]] = {
    "picture": (2134, 1459),
    "shadow maps": (1024, 1024),
    "froxels": (190, 90, 128),
    "screen-space samples": (64,),
}
"""Table 2: the sizes of all its tests."""

VISUAL: Mapping[str, Mapping[str, tuple[float, float, float]]] = {
    "screen_space": {
        "light": (10, 50, 4),
        "exposure": (1, 1, 1),
        "decay": (0.94, 0.9, 0.94),
        "weight": (0.01, 0.002, 0.01),
    },
    "polygonal": {"light": (10, 50, 4), "g": (0.4, 0.5, 0), "tau": (0.3, 1.99e-5, 3.99e-5)},
    "froxel": {
        "light": (10, 50, 4),
        "g": (0.4, 0.5, 0.25),
        "z_limit": (17.6, 11, 40),
        "density": (1, 0.1, 0.02),
        "c_s": (0.1, 0.18, 2),
    },
}
"""Tables 3, 4 and 5: what each technique's look is set to, by scene in the order of :data:`SCENES`. ``light`` is the
light's intensity ``L_c``; the others are called as this project's parameters of the same meaning."""

FPS: Mapping[str, Mapping[str, int]] = {
    "box": {"off": 156, "froxel": 136, "screen_space": 119, "polygonal": 116},
    "blinds": {"off": 103, "froxel": 94, "screen_space": 83, "polygonal": 68},
    "courtyard": {"off": 46, "froxel": 44, "screen_space": 43, "polygonal": 34},
}
"""Table 6: frames per second with one light."""

LIGHTS = (1, 2, 4, 8, 16, 32)
"""Figures 21 and 22: the numbers of lights, in *Bunny Box*."""

MEMORY: Mapping[str, float] = {"froxel": 66.8, "polygonal": 36.0, "screen_space": 0.0}
"""MiB: of the froxels' volumes, of a light's polygonal mesh with its map, and of screen space."""


def milliseconds(scene: str, technique: str) -> float | None:
    """What a technique added to a frame, ``1000/fps − 1000/fps_off``; None where there is no such figure."""
    fps = FPS.get(scene, {})
    if technique == "off" or technique not in fps:
        return None
    return 1000 / fps[technique] - 1000 / fps["off"]
