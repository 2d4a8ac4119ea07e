"""What a hand does on the preview: circles, rectangles of the ring, places, turning."""
