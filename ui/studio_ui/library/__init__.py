"""The material library: what is kept for all projects, seen, searched, and given to things."""
