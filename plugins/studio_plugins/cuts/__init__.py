"""Visibility cuts: every vertex' visibility kept as intervals, its light as the nodes of a tree."""
