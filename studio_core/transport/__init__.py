"""Light from surface to surface: rays that are traced once and kept, what they see, what it sends back."""
