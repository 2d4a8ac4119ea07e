"""Sample projects and the scripts that make them: procedural furniture, rooms and skies."""
