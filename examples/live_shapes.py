"""Another shape while a film runs, in WGSL of one's own: what is there moves on until the other one is compiled."""

from PIL import Image

import tyndall as ty
from tyndall.sdf import box, cylinder, snippet, sphere


@snippet(box=((-0.8,) * 3, (0.8,) * 3), growth=0.75)
def pillow():
    """fn pillow(p: vec3f) -> f32 { return sqrt(sqrt(dot(p * p, p * p))) - 0.8; }"""


thing = ty.Implicit(box(1.1) - cylinder(0.4), name="thing")
sun = ty.DirectionalLight(direction=(-0.5, -1, -0.6), intensity=3)
scene = ty.Scene(lights=[sun], implicits=[thing], motion=lambda time: {"thing": [(min(time, 0.3), 0, 0)]})
with ty.Renderer(scene, (160, 120), volumetric="off", shadow=ty.ShadowMap(size=256)) as renderer:
    renderer.draw(time=0)
    renderer.reshape("thing", pillow() - sphere(0.5).at(0.8, 0.8, 0.8))
    number = 0
    while renderer.pending:
        renderer.draw(time=(number := number + 1) / 60)
    print(f"the pillow came with frame {number}")
    Image.fromarray(renderer.picture()).save("pillow.png")
