"""Stages, jobs and what they compute: the way from a scene to radiance."""
