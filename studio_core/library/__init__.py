"""Materials outside of scenes: files of one material, and the shelf that finds them."""
