"""One picture: sunlight through a round opening, seen in the air."""

import tyndall as ty

scene = ty.scenes.box(lights=1)
picture = ty.render(scene, size=(320, 180), volumetric=ty.Froxel(grid=(80, 45, 32)))
picture.save("first_light.png")  # what a viewer sees
picture.save("first_light.exr")  # linear light, and depth in metres
