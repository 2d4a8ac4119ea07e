"""Materials in from other programs and out to them: one description that all file formats share."""
