"""How a material looks: its ball in the scene's light, its lobe, its albedo, thumbnails."""
