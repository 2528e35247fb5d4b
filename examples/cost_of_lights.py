"""GPU time of the froxel passes for 1, 2 and 4 lights."""

import tyndall as ty

for count in (1, 2, 4):
    scene = ty.scenes.box(lights=count)
    with ty.Renderer(scene, size=(160, 90), volumetric=ty.Froxel(grid=(40, 23, 16))) as renderer:
        samples = []
        for _ in range(4):
            renderer.draw()
            times = renderer.timings()
            samples.append(sum(ms for name, ms in times.items() if name.startswith("volumetric.")))
    print(f"{count} lights: {min(samples):.3f} ms")
