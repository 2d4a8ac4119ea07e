"""Colours, icons and what wears them."""
