"""The window: panels, canvas, and how they reach document and session."""
