"""`slf`: strokes on the surface light field, and the material that explains them (Nguyen et al. 2013)."""
