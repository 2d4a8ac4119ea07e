"""Controls of parameters: from metadata to widgets, and from what is typed to edits."""
