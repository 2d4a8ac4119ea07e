"""Reflectance models as a whole: called from Python, their albedo, and checks of what they promise."""
