"""A terrace under a sunny sky."""
