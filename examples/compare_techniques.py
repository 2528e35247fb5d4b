"""The same view by three techniques: time, memory, and error against a converged ray march."""

import tyndall as ty

scene = ty.scenes.box(lights=1)
result = ty.compare(scene, size=(160, 90), volumetric=["off", "screen_space", "froxel"], frames=3, warmup=1)
print(result)
result.save("comparison")
best = min(result.results, key=lambda r: r.error.rel_rmse)
print(f"closest to the reference: {best.label}, {best.memory_bytes} bytes")
