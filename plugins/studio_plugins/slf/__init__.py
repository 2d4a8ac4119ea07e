"""Strokes on the surface light field: which material explains light that was painted.

After slf-strokes.txt (Nguyen, Scherzer, Ritschel & Seidel, "Material Editing in Complex Scenes by Surface
Light Field Manipulation and Reflectance Optimization", 2013). Solvers work on arrays; no tool paints yet.

- what a stroke says: `samples`; the gloss that is tried: `ladder`
- the material: `constrained` (exact minima among what returns no more light than arrives), `joint` (the
  fewest numbers that explain a whole stroke), `paper` (the paper's choice, element by element)
- where: `elements` (points that stand for all surfaces)
"""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="slf",
    label="Strokes: the material that explains painted light",
    api=API,
    provides={
        "solver": {
            "strokes-joint": "studio_plugins.slf.joint:decide",
            "strokes-paper": "studio_plugins.slf.paper:choose",
        },
    },
)
