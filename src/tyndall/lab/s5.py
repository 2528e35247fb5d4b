"""What S5 published: the frame rates of its four scenes, and those of the same scenes on Shadertoy.

S5 is *Ray marching for games* (2024), a thesis in Rust on wgpu whose scenes are models of Inigo Quilez's: a portrait
(*Selfie Girl*), a snail (*Snail*), a jumping creature (*Happy Jumping*) and a Greek temple (*Greek Temple*), each
measured over 30 s at 1920×1080 on an RTX 3050 Mobile, and on the same machine in a browser at shadertoy.com.
Tyndall's scenes have the subjects, not the models.
"""

from __future__ import annotations

from collections.abc import Mapping

SIZE = (1920, 1080)
SECONDS = 30
ADAPTER = "RTX 3050 Mobile"

FPS: Mapping[str, tuple[int, int]] = {
    "portrait": (45, 10),
    "snail": (120, 27),
    "jumper": (61, 13),
    "temple": (97, 18),
}
"""Frames per second of its program, and on Shadertoy."""
