"""A stool under a panel light: shadow techniques by time, memory, and error against traced truth."""

import numpy as np

import tyndall as ty

x, y, z = np.mgrid[0:2, 0:2, 0:2].reshape(3, -1)
corners = np.stack([x - 0.5, 0.6 + 0.15 * y, z - 0.5], axis=1).astype(np.float32)
sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
faces = np.array([face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))])
slab = ty.Mesh(corners[faces].reshape(-1, 3), np.arange(36).reshape(-1, 3))
ground = ty.Mesh(
    np.array([(-6, 0, -6), (6, 0, -6), (6, 0, 6), (-6, 0, 6)], np.float32), np.array([(0, 2, 1), (0, 3, 2)])
)
panel = ty.RectLight((1.2, 2.5, -0.5), (-0.4, -1, 0.2), 30.0, width=1.0, height=0.6)
scene = ty.Scene((ty.Instance(slab), ty.Instance(ground)), (panel,), ty.Camera((-1, 2.2, 4), (0, 0.4, 0)))
techniques = ["shadow_map", ty.Evsm(size=256), ty.Pcss(samples=48), "shadow_volume", "penumbra_wedge"]
result = ty.compare(scene, size=(96, 54), family="shadow", shadow=techniques, frames=3, warmup=1)
print(result)
result.save("comparison")
