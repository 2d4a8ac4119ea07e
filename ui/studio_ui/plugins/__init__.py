"""Plugins in the window: what there is, their panels, and what happens when one misbehaves."""
