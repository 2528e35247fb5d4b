"""Implicit surfaces: shapes as expressions of signed distance functions, and their evaluation.

>>> from tyndall import sdf
>>> part = sdf.sphere(1) & sdf.box(1.5) - sdf.cylinder(0.5).orient(sdf.X)
>>> part([[0, 0, 0], [2, 0, 0]])
array([0.5 , 1.25])

:mod:`tyndall.sdf.shape` says what a shape is and what can be done to it.
"""

from tyndall.sdf.files import load as load
from tyndall.sdf.files import save as save
from tyndall.sdf.grid import Grid as Grid
from tyndall.sdf.grid import from_mesh as from_mesh
from tyndall.sdf.profiles import PROFILES as PROFILES
from tyndall.sdf.profiles import arc as arc
from tyndall.sdf.profiles import bar as bar
from tyndall.sdf.profiles import circle as circle
from tyndall.sdf.profiles import cross as cross
from tyndall.sdf.profiles import curve as curve
from tyndall.sdf.profiles import cut_disk as cut_disk
from tyndall.sdf.profiles import egg as egg
from tyndall.sdf.profiles import ellipse as ellipse
from tyndall.sdf.profiles import half_plane as half_plane
from tyndall.sdf.profiles import heart as heart
from tyndall.sdf.profiles import hexagon as hexagon
from tyndall.sdf.profiles import horseshoe as horseshoe
from tyndall.sdf.profiles import isosceles as isosceles
from tyndall.sdf.profiles import lens as lens
from tyndall.sdf.profiles import moon as moon
from tyndall.sdf.profiles import octagon as octagon
from tyndall.sdf.profiles import parallelogram as parallelogram
from tyndall.sdf.profiles import pentagon as pentagon
from tyndall.sdf.profiles import pie as pie
from tyndall.sdf.profiles import polygon as polygon
from tyndall.sdf.profiles import rectangle as rectangle
from tyndall.sdf.profiles import regular as regular
from tyndall.sdf.profiles import rhombus as rhombus
from tyndall.sdf.profiles import ring as ring
from tyndall.sdf.profiles import rounded_rectangle as rounded_rectangle
from tyndall.sdf.profiles import segment as segment
from tyndall.sdf.profiles import star as star
from tyndall.sdf.profiles import trapezoid as trapezoid
from tyndall.sdf.profiles import triangle as triangle
from tyndall.sdf.profiles import uneven_capsule as uneven_capsule
from tyndall.sdf.shading import FragmentShader as FragmentShader
from tyndall.sdf.shading import ShadedMaterial as ShadedMaterial
from tyndall.sdf.shape import Shape as Shape
from tyndall.sdf.shape import X as X
from tyndall.sdf.shape import Y as Y
from tyndall.sdf.shape import Z as Z
from tyndall.sdf.shape import intersection as intersection
from tyndall.sdf.shape import subtraction as subtraction
from tyndall.sdf.shape import union as union
from tyndall.sdf.snippets import SnippetError as SnippetError
from tyndall.sdf.snippets import snippet as snippet
from tyndall.sdf.solids import SOLIDS as SOLIDS
from tyndall.sdf.solids import box as box
from tyndall.sdf.solids import box_frame as box_frame
from tyndall.sdf.solids import capped_cone as capped_cone
from tyndall.sdf.solids import capped_torus as capped_torus
from tyndall.sdf.solids import capsule as capsule
from tyndall.sdf.solids import cone as cone
from tyndall.sdf.solids import cut_hollow_sphere as cut_hollow_sphere
from tyndall.sdf.solids import cut_sphere as cut_sphere
from tyndall.sdf.solids import cylinder as cylinder
from tyndall.sdf.solids import death_star as death_star
from tyndall.sdf.solids import dodecahedron as dodecahedron
from tyndall.sdf.solids import ellipsoid as ellipsoid
from tyndall.sdf.solids import gyroid as gyroid
from tyndall.sdf.solids import hexagonal_prism as hexagonal_prism
from tyndall.sdf.solids import icosahedron as icosahedron
from tyndall.sdf.solids import infinite_cone as infinite_cone
from tyndall.sdf.solids import link as link
from tyndall.sdf.solids import octagonal_prism as octagonal_prism
from tyndall.sdf.solids import octahedron as octahedron
from tyndall.sdf.solids import plane as plane
from tyndall.sdf.solids import pyramid as pyramid
from tyndall.sdf.solids import rhombic_prism as rhombic_prism
from tyndall.sdf.solids import round_cone as round_cone
from tyndall.sdf.solids import rounded_box as rounded_box
from tyndall.sdf.solids import rounded_cylinder as rounded_cylinder
from tyndall.sdf.solids import solid_angle as solid_angle
from tyndall.sdf.solids import sphere as sphere
from tyndall.sdf.solids import tetrahedron as tetrahedron
from tyndall.sdf.solids import torus as torus
from tyndall.sdf.solids import triangular_prism as triangular_prism
from tyndall.sdf.solids import tube as tube
from tyndall.sdf.solids import vesica as vesica
from tyndall.sdf.solids import wedge as wedge
