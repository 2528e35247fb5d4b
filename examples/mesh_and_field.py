"""There and back: a shape becomes triangles, triangles become a shape, and two of those melt into one."""

import tyndall as ty
from tyndall.sdf import Y, box_frame, from_mesh, sphere, union

frame = box_frame(1.2, 0.2).twist(0.8).to_mesh(48)  # any closed mesh does, as of ty.load("bunny.obj")
print(f"{frame.triangle_count:,} triangles")
ty.save(ty.Scene(instances=(ty.Instance(frame),), name="frame"), "frame.json")

grid = from_mesh(frame, 32)
print(f"{grid.samples.size:,} samples, L = {grid.lipschitz:.2f}")
melted = union(grid.at(-0.45), grid.rotate(0.9, Y).at(0.75, 0.2), sphere(0.35).at(0.1, 0.5), smooth=0.25)
scene = ty.Scene(
    implicits=(ty.Implicit(melted, material=ty.Material(base_color=(0.7, 0.2, 0.1, 1), roughness=0.4)),),
    lights=(ty.DirectionalLight(direction=(-0.4, -1, -0.7), intensity=3),),
    camera=ty.Camera(position=(0.8, 1.4, 3.6), target=(0.1, 0.1, 0)),
    ambient=(0.2, 0.2, 0.25),
    background=(0.05, 0.06, 0.08),
)
ty.render(scene, size=(240, 135), volumetric="off", shadow=ty.ShadowMap(size=512), frames=4).save("melted.png")
