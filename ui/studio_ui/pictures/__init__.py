"""Pictures out of the window: one, many, or onto the clipboard."""
