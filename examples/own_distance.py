"""A shape of one's own in WGSL, and what it is made into with the shapes that are there."""

import tyndall as ty
from tyndall.sdf import capsule, snippet, union


@snippet(lipschitz=1.0, growth=0.6, box=lambda radius, waves: ((-2 * radius,) * 3, (2 * radius,) * 3))
def urchin(radius: float = 0.8, waves: float = 9.0):
    """A ball with waves all around; as the waves are steep, the value is 0.6 of what it would be.

    fn urchin(p: vec3f, radius: f32, waves: f32) -> f32 {
        let around = sin(waves * p.x) * sin(waves * p.y) * sin(waves * p.z);
        return 0.6 * (length(p) - radius + 0.6 / waves * around);
    }
    """


family = union(urchin(), urchin(0.4, 14).at(1.2, 0.2), capsule((-1, -1, 0), (1, -1, 0)), smooth=0.3)
scene = ty.Scene(
    implicits=(ty.Implicit(family, material=ty.Material(base_color=(0.35, 0.1, 0.4, 1), roughness=0.4)),),
    lights=(ty.DirectionalLight(direction=(-0.5, -1, -0.8), intensity=3),),
    camera=ty.Camera(position=(0.4, 0.8, 4), target=(0.3, -0.1, 0)),
    ambient=(0.3, 0.3, 0.4),
)
ty.render(scene, size=(320, 180), volumetric="off", shadow=ty.ShadowMap(size=512), frames=4).save("urchin.png")
