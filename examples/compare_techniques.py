"""The same view by four techniques: time, memory, and error against a converged ray march."""

import tyndall as ty

scene = ty.scenes.box(lights=1)
techniques = ["off", "screen_space", "polygonal", ty.Froxel(grid=(80, 45, 32))]
result = ty.compare(scene, size=(96, 54), volumetric=techniques, truth="march", frames=3, warmup=1)
print(result)
result.save("comparison")
best = min(result.results, key=lambda r: r.error.rel_rmse)
print(f"closest to the truth: {best.label}, {best.memory_bytes} bytes")
