"""Implicit surfaces: shapes as expressions of signed distance functions, and their evaluation."""

from tyndall.sdf.grid import Grid as Grid
from tyndall.sdf.grid import from_mesh as from_mesh
from tyndall.sdf.shape import Shape as Shape
from tyndall.sdf.shape import X as X
from tyndall.sdf.shape import Y as Y
from tyndall.sdf.shape import Z as Z
from tyndall.sdf.shape import intersection as intersection
from tyndall.sdf.shape import subtraction as subtraction
from tyndall.sdf.shape import union as union
from tyndall.sdf.solids import box as box
from tyndall.sdf.solids import sphere as sphere
