"""The scene as a frozen value: nodes, materials, transforms, what differs between two scenes."""
