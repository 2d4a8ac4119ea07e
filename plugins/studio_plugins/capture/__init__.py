"""Capture: two fisheye photographs of a room, at several exposures, become an HDR environment (cuts.txt, IV).

Stages are pure functions of pictures and settings, one a module; `pipeline` puts them in order.
"""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="capture",
    label="Capture: a room's light from photographs",
    api=API,
    provides={"capturer": {"fisheye": "studio_plugins.capture.pipeline:CAPTURER"}},
)
