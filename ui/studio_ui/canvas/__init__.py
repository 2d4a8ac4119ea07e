"""The picture and everything done with the mouse in it."""
