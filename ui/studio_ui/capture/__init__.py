"""The capture panel: photographs of a room become its light, step by step, each with a preview."""
