"""The camera walks an arc around the figure; the frames become one animated picture."""

import dataclasses
import math

from PIL import Image

import tyndall as ty

scene = ty.scenes.box(lights=1)
(tx, _, tz), (x, y, z) = scene.camera.target, scene.camera.position
radius, start = math.hypot(x - tx, z - tz), math.atan2(x - tx, z - tz)
frames = []
with ty.Renderer(scene, size=(160, 90), volumetric=ty.Froxel(grid=(40, 23, 16))) as renderer:
    for step in range(8):
        angle = start + math.radians(3) * step
        position = (tx + radius * math.sin(angle), y, tz + radius * math.cos(angle))
        renderer.draw(dataclasses.replace(scene.camera, position=position))
        frames.append(Image.fromarray(renderer.picture()))
frames[0].save("orbit.webp", save_all=True, append_images=frames[1:], duration=80, loop=0)
