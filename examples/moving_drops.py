"""Two hundred drops that melt into one another, all of them moving: a buffer write a frame, and nothing is compiled."""

import numpy as np
from PIL import Image

import tyndall as ty
from tyndall.sdf import sphere, union

rng = np.random.default_rng(1)
places, radii, speeds = rng.normal(0, 0.6, (200, 3)), rng.uniform(0.06, 0.2, 200), rng.uniform(0.5, 2, (200, 3))
drops = union(*(sphere(r).at(*p).named("drop") for r, p in zip(radii, places, strict=True)), smooth=0.15)
scene = ty.Scene(
    implicits=(ty.Implicit(drops, material=ty.Material(base_color=(0.1, 0.4, 0.6, 1), roughness=0.2)),),
    lights=(ty.DirectionalLight(direction=(-0.5, -1, -0.6), intensity=3),),
    camera=ty.Camera(position=(0, 0.5, 5)),
    ambient=(0.3, 0.3, 0.3),
    motion=lambda time: {"drop": 0.4 * np.sin(time * speeds)},
    room=((-2.5, -2.5, -2.5), (2.5, 2.5, 2.5)),
)
frames = []
with ty.Renderer(scene, (160, 120), volumetric="off", shadow=ty.ShadowMap(size=256)) as renderer:
    for number in range(6):
        renderer.draw(time=number / 4)
        frames.append(Image.fromarray(renderer.picture()))
frames[0].save("drops.webp", save_all=True, append_images=frames[1:], duration=80, loop=0)
