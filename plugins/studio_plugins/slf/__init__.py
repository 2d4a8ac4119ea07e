"""Strokes on the surface light field: which material explains light that was painted.

After slf-strokes.txt (Nguyen, Scherzer, Ritschel & Seidel, "Material Editing in Complex Scenes by Surface
Light Field Manipulation and Reflectance Optimization", 2013).

- light: `places` (a stroke's marks in the world), `incident` (what reaches them), `columns` (what each term
  of a model sends of it, at the gloss levels of `ladder`)
- the material: `dressed` (a scene's material by its colour, shine and gloss), `samples`, `grams` (the best of
  all that return no more light than arrives), `joint` (the fewest numbers that explain a whole stroke),
  `paper` (the paper's choice, element by element)
- where: `regions`, `elements` (points that stand for all surfaces)
- how far: `looks`, `spots`, `similarity` (what is alike a stroke), `upsampling` (from elements to all else),
  `field` (the change that is wanted anywhere), `points` and `spread` (paint that has it)
- what is reflected: `fixates` (what strokes in indirect mode ask for), `influence`, `further`, `receiving`
  and `trials` (columns of what others send), `changeable` and `candidates` (what may have changed),
  `recolouring` (the edit), `reflected` (the decision)
- `explaining` (one decision), `outcome` (the edit, and why), `solver` (the door)
- the paper's own solvers: `touched` (light at elements that strokes lie on), `painted_rows` (strokes in their
  moments), `retold` (a model's numbers in the paper's terms), `elementwise` (each by itself), `by_element`
- all elements at once: `links` (what they see), `lumitexels` and `series` (light of all directions), `lobes`,
  `skylight`, `straight`, `moments`, `mixed`, and `whole` above them
- to be seen: `appearance`, `splatting`, `backend`; the whole scene sharpened: `stylise`
"""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="slf",
    label="Strokes: the material that explains painted light",
    api=API,
    provides={
        "backend": {"slf": "studio_plugins.slf.backend:BACKEND"},
        "solver": {
            "joint": "studio_plugins.slf.solver:SOLVER",
            "mixed": "studio_plugins.slf.by_element:MIXED",
            "l0": "studio_plugins.slf.by_element:SPARSE",
            "l2": "studio_plugins.slf.by_element:FULL",
        },
    },
)
