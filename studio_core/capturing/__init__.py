"""Capture: what a room's photographs become. Settings, what the stages make, and the edits.

The stages themselves are a plugin of the kind `capturer` (`studio_plugins.capture`).
"""
