"""Materials from photographs of a sample under known lamps: what is asked for, and how good it became."""
