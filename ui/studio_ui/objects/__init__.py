"""What is done to things of the scene: choosing, arranging, snapping, rooms, materials dropped."""
