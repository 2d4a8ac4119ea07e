"""Dockable panels. They read the scene and write edits; none knows another."""
