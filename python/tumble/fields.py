"""Fields on grids and the verbs on them, for learning and for checking: what fluids and heat are computed with.

>>> from tumble.fields import Grid, gradient
>>> grid = Grid((64, 64), spacing=1 / 64)
>>> heat = grid.field(lambda x, y: x * y, "cell", unit="K")
>>> slope_x, slope_y = gradient(heat)
>>> slope_x.array.shape, slope_x.place, slope_x.unit
((65, 64), 'face x', 'K/m')

A field knows its place: "cell", "face x", "edge x" (or y, z) or "node"; mixing places raises TumbleError. Vectors are the
fields of their components, on faces or on edges. Results lie between closed walls; advect and diffuse keep the sides of what
they are given. project takes from a velocity what makes it diverge, by any solver of the ladder, and tells how that went.
Theory: docs/theory/grids.md, docs/theory/pressure.md. All in double precision, by choice but project.
"""

from tumble._engine import (
    Field,
    Grid,
    Projection,
    advect,
    average,
    curl,
    diffuse,
    diffusion_limit,
    directional,
    divergence,
    gradient,
    laplacian,
    project,
    sample,
)

__all__ = [
    "Field",
    "Grid",
    "Projection",
    "advect",
    "average",
    "curl",
    "diffuse",
    "diffusion_limit",
    "directional",
    "divergence",
    "gradient",
    "laplacian",
    "project",
    "sample",
]
