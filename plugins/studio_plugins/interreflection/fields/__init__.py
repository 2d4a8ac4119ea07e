"""The paper's own method (Iwasaki et al. 2007): light of other objects by precomputed radiance fields.

Section by section: `bases` (5.2, equations 6 and 7) makes an object's radiance of few functions over its
vertices, `training` lights it for that (figure 2), `precompute` makes the fields of equation 5 at the places
of `lattice`, as `harmonics`, `store` keeps them, `transfer` carries light between objects, `method` is the
indirect method that is chosen. Equations 1 to 4, separated BRDFs, are `studio_core.transport.separable`.

As in the paper an object's own light never comes back to it, and nothing between two objects stops light. A
room in one mesh would thus lose nearly all of its light: `parts` takes hollow objects apart, as the paper's
rooms consist of separate walls.
"""
