"""Large pictures on the screen: zoom, exposure, marks, before and after; nothing here knows of captures."""
