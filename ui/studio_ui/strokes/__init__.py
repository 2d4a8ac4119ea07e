"""Strokes in the window: the brush on the picture, the panel, and what the solver says of them."""
