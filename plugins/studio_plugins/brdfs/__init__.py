"""Reflectance models, one file each."""

from studio_core.contract import API, Plugin

_HERE = "studio_plugins.brdfs"
plugin = Plugin(
    id="brdfs",
    label="Reflectance models",
    api=API,
    provides={
        "brdf": {
            "lambert": f"{_HERE}.lambert:MODEL",
            "oren-nayar": f"{_HERE}.oren_nayar:MODEL",
            "phong": f"{_HERE}.phong:MODEL",
            "blinn-phong": f"{_HERE}.blinn_phong:MODEL",
            "ggx": f"{_HERE}.ggx:MODEL",
            "specgloss": f"{_HERE}.specgloss:MODEL",
            "ggx-conductor": f"{_HERE}.ggx_conductor:MODEL",
            "ggx-dielectric": f"{_HERE}.ggx_dielectric:MODEL",
            "plastic": f"{_HERE}.plastic:MODEL",
            "ward": f"{_HERE}.ward:MODEL",
            "ashikhmin-shirley": f"{_HERE}.ashikhmin_shirley:MODEL",
            "cloth": f"{_HERE}.cloth:MODEL",
            "measured": f"{_HERE}.measured:MODEL",
        },
        "importer": {
            "material": f"{_HERE}.material_file:MATERIAL",
            "merl": f"{_HERE}.measured_files:MERL",
            "tabulated": f"{_HERE}.measured_files:TABULATED",
        },
    },
)
