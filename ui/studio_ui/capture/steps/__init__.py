"""The steps of a capture: a form each, and what the preview shows for it."""
