"""Implicit surfaces: shapes as expressions of signed distance functions, and their evaluation."""

from tyndall.sdf.files import load as load
from tyndall.sdf.files import save as save
from tyndall.sdf.shading import FragmentShader as FragmentShader
from tyndall.sdf.shading import ShadedMaterial as ShadedMaterial
from tyndall.sdf.shape import X as X
from tyndall.sdf.shape import Y as Y
from tyndall.sdf.shape import Z as Z
from tyndall.sdf.shape import intersection as intersection
from tyndall.sdf.shape import subtraction as subtraction
from tyndall.sdf.shape import union as union
from tyndall.sdf.snippets import SnippetError as SnippetError
from tyndall.sdf.snippets import snippet as snippet
from tyndall.sdf.solids import box as box
from tyndall.sdf.solids import sphere as sphere
