"""Pictures of fields: distances around a shape, and where they change slower than a true distance would."""

from tyndall.sdf import box, sphere, star, union

shape = union(sphere(0.6).at(-0.5), box(0.9).rotate(0.4).at(0.6, 0.2), smooth=0.3) - sphere(0.3).at(0.1, 0.4)
shape.show_slice(z=0).save("slice.png")  # in a notebook, the last line of a cell shows itself
shape.show_slice(y=0.3, size=4).save("from_above.png")
gradient = shape.show_gradient(z=0)
gradient.save("gradient.png")
print(f"declared to be at most {shape.lipschitz:g}, found {gradient.least:.2f} to {gradient.greatest:.2f}")
star(6, 1.0, 0.5).round(0.1).show_slice().save("star.png")  # flat shapes have their own plane
