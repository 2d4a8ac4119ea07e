"""What the mouse does in the picture, as Help tells it."""

MOUSE = (
    ("Choose", "Click; Ctrl+click adds"),
    ("Choose a part of a group", "Double-click; Esc leaves the group"),
    ("Look around", "Left drag on what is not chosen, or Alt+left drag, or middle drag"),
    ("Slide the view", "Right drag, or Shift+middle drag"),
    ("Zoom to the cursor", "Wheel"),
    ("Move what is chosen", "Left drag on it; Shift up and down; Ctrl in 5 cm steps; Esc cancels"),
    ("Turn what is chosen", "R held and left drag, or the Rotate tool; Ctrl in 15° steps"),
    ("Turn the light", "Shift+right drag"),
)
