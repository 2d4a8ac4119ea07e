"""A furnished living room by daylight."""
