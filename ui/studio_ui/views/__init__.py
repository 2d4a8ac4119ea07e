"""Looking: cameras of the scene, view controls, and what lies over the picture."""
