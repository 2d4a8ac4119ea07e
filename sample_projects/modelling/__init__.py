"""What all samples are made with: meshes, shapes, sky, light from all around, textures."""
