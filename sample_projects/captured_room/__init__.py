"""The living room with captured materials: woven wool on the sofa, limestone on the floor."""
