"""A sweep: what froxels cost, and how right they are, by the size of their grid and the number of lights."""

import tyndall as ty

spec = {
    "scenes": "box",
    "lights": [1, 2],
    "sizes": "48x27",
    "techniques": ["off", {"technique": "froxel", "grid": [[12, 7, 8], [24, 14, 16]]}],
    "truth": "march",
    "frames": 3,
    "warmup": 1,
}
found = ty.sweep(spec, "sweep", workers=0)  # stopped and started again, it goes on where it was
print(found)
best = min(found.rows, key=lambda row: row["errors"]["inscattered"]["rel_rmse"])
print(f"closest: {best['point']['technique']['grid']} in {best['gpu_ms']['median']:.2f} ms")
