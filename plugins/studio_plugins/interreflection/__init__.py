"""Light between surfaces while they move (Iwasaki et al., "Fast Calculation of Interreflection …", 2007).

- `gather`: cached rays that carry light from surface to surface; quick in hand, exact at rest
- `fields`: the paper's own method, radiance fields of principal components
"""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="interreflection",
    label="Light between surfaces",
    api=API,
    provides={
        "indirect": {
            "gather": "studio_plugins.interreflection.gather.method:METHOD",
            "fields": "studio_plugins.interreflection.fields.method:METHOD",
        }
    },
)
