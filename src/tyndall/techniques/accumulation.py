"""Means over frames of what is sampled in each pixel.

A technique that takes a few random samples a pixel and frame keeps their mean in an image, and in the next frame reads
it where the surface was (Nehab 2007; the picture's motion vectors). What it finds there counts if it was of the same
surface: of like depth and normal, each of four neighbours by itself.

While the camera moves, the mean looks back as far as the technique says, since each look between pixels blurs. Once the
camera has stood still for three frames, what was gathered on the move counts as four frames, those three among them;
from then on a pixel's mean is that of all frames, and it converges to the truth. Of a camera that has not moved since
the first frame, all frames count.

Where there is no mean yet, the first batch of samples is larger. One sample alone would show for long: antialiasing
takes the mean of pictures, and each of the next few holds mostly that sample.

A mean is kept in 32 bits, of which 21 are of the value, in 0 … 1 with both ends exact, and 11 of the number of frames.
``accumulation.wesl`` is the shader's side; it imports what :func:`accumulated` binds.
"""

from __future__ import annotations

from typing import Any

from tyndall.gpu.resources import Texture
from tyndall.techniques.contract import View


def accumulated(view: View, layers: int) -> tuple[Texture, dict[str, Any]]:
    """The image of this frame's means, (width, height, layers) r32uint, and what the shader that makes them binds."""
    means = [view.texture(f"means{i}", (*view.size, layers), "r32uint", dimension="2d-array") for i in range(2)]
    surfaces = [view.texture(f"surfaces{i}", view.size, "rg32uint") for i in range(2)]
    now, past = view.frame % 2, (view.frame + 1) % 2
    return means[now], {
        "means_out": means[now].write(),
        "past_means": means[past],
        "surfaces_out": surfaces[now].write(),
        "past_surfaces": surfaces[past],
    }
