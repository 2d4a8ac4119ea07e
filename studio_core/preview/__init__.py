"""Small pictures and curves that show what a material is like, without a scene around it."""
