"""Bundled plugins, one folder each: they know the core and not each other."""
