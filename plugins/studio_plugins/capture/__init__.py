"""Capture: two fisheye photographs of a room, at several exposures, become an HDR environment (cuts.txt, IV).

Stages are pure functions of pictures and settings; `pipeline` puts them in order, `progress` remembers
what they made. What materials need too (response, merging, alignment, cloning) is in `studio_core.imaging`.

- photographs: `bracket` (with `bracket_sides`, `_looks`, `_turns`, `_exposures`)
- lenses: `circle`, `circle_edge`; `sides` takes two circles in one picture apart
- how they stand: `register` (`overlap`, `guesses`, `refine`, `solve`, `falloff`)
- reflections of the frame: `reflections` (`ring`, `compare`, `overlap_balance`), `removal`
- one picture: `level`, `stitch` (`sampling`, `seam`, `fill`)
- colour and scale: `calibrate`, `clipped`; `result` is the end, with the report
"""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="capture",
    label="Capture: a room's light from photographs",
    api=API,
    provides={"capturer": {"fisheye": "studio_plugins.capture.pipeline:CAPTURER"}},
)
