"""Reflectance models as a whole: called from Python, their albedo, what they promise, and measurements."""
