"""A plugin that needs what is not installed."""

import a_library_that_nobody_has  # noqa: F401

from studio_core.contract import API, Plugin

plugin = Plugin(id="example-broken", api=API)
