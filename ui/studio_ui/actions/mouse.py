"""What the mouse does in the picture, as Help tells it; looking around is told by the preset in use."""

MOUSE = (
    ("Choose", "Click; Ctrl+click adds"),
    ("Choose a part of a group", "Double-click; Esc leaves the group"),
    ("Move what is chosen", "Left drag on it; Shift up and down; Ctrl in 5 cm steps; Esc cancels"),
    ("Turn what is chosen", "R held and left drag, or the Rotate tool; Ctrl in 15° steps"),
)
