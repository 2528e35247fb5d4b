"""A scene from arrays: a pyramid under a spot light in blue haze, saved as a scene file and drawn."""

import numpy as np

import tyndall as ty

corners = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1), (0, 1.4, 0)], np.float32)
sides = np.array([(0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)])
pyramid = ty.Mesh(corners[sides].reshape(-1, 3), np.arange(12).reshape(-1, 3), material=ty.Material(roughness=0.4))
ground = ty.Mesh(corners[:4] * 8, np.array([(0, 2, 1), (0, 3, 2)]))
scene = ty.Scene(
    instances=(ty.Instance(pyramid), ty.Instance(ground)),
    lights=(ty.SpotLight(position=(3, 5, 2), direction=(-3, -5, -2), intensity=900, outer_angle=0.35),),
    camera=ty.Camera(position=(0, 1.6, 7), target=(0, 1, 0)),
    medium=ty.Medium(scattering=(0.04, 0.06, 0.1), phase=ty.HenyeyGreenstein(0.5)),
    ambient=(0.02, 0.03, 0.04),
    name="pyramid",
)
ty.save(scene, "pyramid.json")
ty.render(ty.load("pyramid.json"), size=(320, 180), volumetric=ty.March(steps=32), frames=4).save("pyramid.png")
