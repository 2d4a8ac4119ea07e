"""Pictures: reading, writing, environments."""
