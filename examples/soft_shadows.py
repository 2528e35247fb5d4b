"""One lamp as a point, a bulb and a lantern: rays soften its shadow, and contacts darken as under a grey sky."""

import numpy as np

import tyndall as ty

corners = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1), (0, 1.4, 0)], np.float32)
sides = np.array([(0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)])
pyramid = ty.Mesh(corners[sides].reshape(-1, 3), np.arange(12).reshape(-1, 3))
ground = ty.Mesh(corners[:4] * 8, np.array([(0, 2, 1), (0, 3, 2)]))
scene = ty.Scene(
    instances=(ty.Instance(pyramid), ty.Instance(ground)),
    camera=ty.Camera(position=(-1, 3, 6), target=(-0.6, 0.2, 0)),
    ambient=(0.15, 0.15, 0.17),
)
for name, radius in (("point", 0.0), ("bulb", 0.15), ("lantern", 0.6)):
    lamp = ty.PointLight(position=(2.5, 3, 1.5), intensity=40, radius=radius)
    lit = scene.with_(lights=(lamp,))
    picture = ty.render(
        lit, size=(240, 135), volumetric="off", shadow="ray_traced", occlusion="ray_traced_ao", frames=8
    )
    picture.save(f"{name}.png")
