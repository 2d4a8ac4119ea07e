"""The numerical kernels: directions, light, rays, visibility. See docs/decisions/0002 for how they run."""
