"""A machine's part from signed distances: drilled, joined softly, painted, and lit on a floor of triangles."""

import numpy as np

import tyndall as ty
from tyndall.sdf import X, Y, box, cylinder, hexagon, sphere, union

brass = ty.Material(base_color=(0.9, 0.6, 0.25, 1), metallic=1, roughness=0.3)
core = (sphere(1) & box(1.5)) - (cylinder(0.5) | cylinder(0.5).orient(X) | cylinder(0.5).orient(Y))
feet = cylinder(0.12, 0.3).at(0.55, 0.55, -0.7).polar(4)
nut = (hexagon(0.4).extrude(0.3) - cylinder(0.22)).round(0.02).material(brass)
part = (union(core, feet, smooth=0.1) | nut.at(z=-0.45)).rotate(-np.pi / 2, X).at(y=0.85)
print(f"{part.count} nodes, L = {part.lipschitz:g}, in the box {np.round(part.box, 2).tolist()}")

corners = np.array([(-6, 0, -6), (6, 0, -6), (6, 0, 6), (-6, 0, 6)], np.float32)
scene = ty.Scene(
    instances=(ty.Instance(ty.Mesh(corners, np.array([(0, 2, 1), (0, 3, 2)]))),),
    implicits=(ty.Implicit(part, material=ty.Material(base_color=(0.1, 0.3, 0.5, 1), roughness=0.5)),),
    lights=(ty.DirectionalLight(direction=(-0.6, -1, -0.5), intensity=3),),
    camera=ty.Camera(position=(1.9, 2.3, 2.5), target=(0, 0.75, 0)),
    ambient=(0.3, 0.32, 0.36),
)
ty.render(scene, size=(320, 180), volumetric="off", frames=4).save("part.png")
