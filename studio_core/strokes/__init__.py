"""Strokes: light that somebody painted on the picture, and what a solver makes of it.

A stroke is a node of the scene (`stroke`): so it is saved, undone, renamed and switched off like everything
else. It holds marks (`marks`): places on surfaces, the light that was shown there and the light that is
wanted. A solver (`studio_core.contract.StrokeSolver`) finds the change of materials that explains all of
them, and returns it as an edit with its reasons (`solution`).

- by hand: `brush`, `tools`, `picking` (colours of the screen as light), `painting` and `cells` (marks)
- in the document: `edits`; in files: `files`, `planned`; without a window: `session`
"""
