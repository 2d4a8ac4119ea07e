"""The command palette: everything the menus offer, found by a few letters."""
