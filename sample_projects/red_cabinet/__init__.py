"""A small white room with a red cabinet in the sun: drag it, and its tint goes along over wall and floor."""
