"""What the mouse does in the picture, as Help tells it; looking around is told by the preset in use."""

MOUSE = (
    ("Choose", "Click; Ctrl+click adds or takes away"),
    ("Choose a part of a group", "Double-click; Esc leaves the group"),
    ("Move what is chosen", "W; drag it, an arrow or a square; Shift: up and down; Esc cancels"),
    ("Turn what is chosen", "E; drag a ring, or the thing itself"),
    ("Scale what is chosen", "R; drag a handle: all sides grow alike"),
    ("Copy while dragging", "Alt+left drag on a handle or on what is chosen"),
    ("Along an axis", "X, Y or Z, before a drag or in it; Shift+X: along the other two"),
    ("An exact amount", "Type it while dragging: 80 cm, 2'6\", 45°; Enter keeps it"),
    ("With and without snapping", "M; while dragging hold Ctrl"),
    ("Paint light", "P, then drag; Shift: straight; Esc takes it back"),
    ("Pick a colour of the picture", "P, then Alt+click; Ctrl+click: where cloning takes it from"),
    ("Size and hardness of the brush", "[ and ], Ctrl+wheel; Shift+[ and Shift+], Ctrl+Shift+wheel"),
    ("Choose in a box", "Q or B, then drag: to the right what lies inside, to the left what is touched"),
)
