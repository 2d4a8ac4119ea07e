"""Isotropic reflectance tabulated by directions and wavelengths, as text.

Two forms of the same. *ASTM*, as the Cornell measurements have it (after ASTM E1392): header lines of a key
and a value, then `VARS theta_i,phi_i,theta_s,phi_s,400nm,410nm,…` and one line of numbers a sample, angles in
radians. *CSV*, our own: a line of column names, then one line of numbers a sample, angles in degrees:

    # name: Blue felt
    # illuminant: D65
    theta_i,theta_o,phi,400nm,450nm,500nm,550nm,600nm,650nm,700nm
    0,30,0,0.021,0.034,0.029,0.018,0.015,0.014,0.013

Thetas count from the normal, phi is the difference of azimuths: 180° is where a mirror would send the light
(or `phi_i` and `phi_o`). Reflectance columns are wavelengths, or R,G,B (linear Rec.709), or X,Y,Z, in 1/sr.
Lines with `#` may give `name`, `illuminant` (D65 or E, under which spectra and XYZ are seen) and `angles`
(degrees or radians). Data that lie on one side of the plane of incidence are taken for those of the other
side, too.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.brdfs import spectra
from studio_core.brdfs.samples import Samples
from studio_core.errors import InputError

F64 = npt.NDArray[np.float64]

MOST_BYTES = 64 << 20
LEAST_SAMPLES = 12
BRIGHTEST = 1e7
_WAVELENGTH = re.compile(r"(\d+(?:\.\d+)?)\s*(?:nm)?\Z")
_ANGLES = {
    "theta_i": "theta_i",
    "phi_i": "phi_i",
    "theta_o": "theta_o",
    "theta_s": "theta_o",
    "theta_r": "theta_o",
    "phi_o": "phi_o",
    "phi_s": "phi_o",
    "phi_r": "phi_o",
    "phi": "phi_o",
}


@dataclass(frozen=True)
class Tabulated:
    """What a file holds as samples, its name, and in sentences what was changed."""

    samples: Samples
    name: str
    notes: tuple[str, ...]


def read(path: Path) -> Tabulated:
    """Samples of an ASTM or CSV file; InputError in one sentence naming file, cause and line."""
    try:
        if not path.is_file():
            raise _refused(path, "there is no such file")
        if path.stat().st_size > MOST_BYTES:
            raise _refused(path, f"it is larger than the {MOST_BYTES >> 20} MB that are accepted")
        text = path.read_text("utf-8", errors="replace")
    except OSError as error:
        raise _refused(path, error.strerror or str(error)) from None
    lines = text.splitlines()
    facts, names, first = _head(path, lines)
    numbers = _numbers(path, lines[first:], first, len(names))
    if facts.get("num_points", str(len(numbers))) != str(len(numbers)):
        raise _refused(path, f"it says {facts['num_points'][:20]} samples and has {len(numbers)}")
    return _tabulated(path, facts, names, numbers)


def _refused(path: Path, cause: str) -> InputError:
    return InputError(f"{path} cannot be imported: {cause}")


def _head(path: Path, lines: list[str]) -> tuple[dict[str, str], list[str], int]:
    """Facts by lower-case key, column names, and where the numbers begin."""
    facts = {"angles": "degrees"}
    for n, line in enumerate(lines):
        bare = line.strip()
        if bare.startswith("#"):
            key, colon, value = bare.lstrip("# ").partition(":")
            if colon:
                facts[key.strip().lower()] = value.strip()
        elif bare.upper().startswith("VARS"):
            return facts | {"angles": "radians"}, _names(bare[4:].lstrip(" =:")), n + 1
        elif "theta_i" in bare.lower():
            return facts, _names(bare), n + 1
        elif bare:
            key, _, value = bare.partition(" ")
            facts[key.lower()] = value.strip()
    raise _refused(path, "it has no line of columns (theta_i, theta_o, phi and wavelengths)")


def _names(line: str) -> list[str]:
    return [name.strip().strip('"') for name in line.split(",")]


def _numbers(path: Path, lines: list[str], first: int, width: int) -> F64:
    rows = []
    for n, line in enumerate(lines, first + 1):
        bare = line.strip()
        if not bare or bare.startswith("#"):
            continue
        parts = bare.split(",")
        try:
            rows.append([float(part) for part in parts])
        except ValueError:
            raise _refused(path, f"line {n} is not made of numbers") from None
        if len(parts) != width:
            raise _refused(path, f"line {n} has {len(parts)} numbers, {width} are named")
    if len(rows) < LEAST_SAMPLES:
        raise _refused(path, f"it has {len(rows)} samples, at least {LEAST_SAMPLES} are needed")
    made = np.array(rows)
    if not np.isfinite(made).all():
        raise _refused(path, "it holds numbers that are not finite")
    return made


def _tabulated(path: Path, facts: dict[str, str], names: list[str], numbers: F64) -> Tabulated:
    light = facts.get("illuminant", "D65").upper()
    if light not in spectra.ILLUMINANTS:
        raise _refused(path, f"the illuminant {light[:20]!r} is unknown; D65 and E are known")
    if facts["angles"] not in ("degrees", "radians"):
        raise _refused(path, f"angles are in degrees or radians, not in {facts['angles'][:20]!r}")
    columns = {_ANGLES[name.lower()]: n for n, name in enumerate(names) if name.lower() in _ANGLES}
    rest = [n for n, name in enumerate(names) if name.lower() not in _ANGLES]
    for needed in ("theta_i", "theta_o", "phi_o"):
        if needed not in columns:
            raise _refused(path, f"it has no column {needed.replace('phi_o', 'phi')}")
    factor = 1.0 if facts["angles"] == "radians" else np.pi / 180
    theta_i, theta_o = numbers[:, columns["theta_i"]] * factor, numbers[:, columns["theta_o"]] * factor
    phi = numbers[:, columns["phi_o"]] * factor
    if "phi_i" in columns:
        phi = phi - numbers[:, columns["phi_i"]] * factor
    if max(np.abs(theta_i).max(), np.abs(theta_o).max()) > np.pi + 1e-6:
        raise _refused(path, f"it has angles beyond 180°; they are read as {facts['angles']}")
    notes: list[str] = []
    values = _colours(path, [names[n] for n in rest], numbers[:, rest], light, notes)
    if np.abs(values).max() > BRIGHTEST:
        raise _refused(path, f"a value of {np.abs(values).max():.3g} per steradian is no reflectance")
    dark = float((values < 0).any(axis=1).mean())
    if dark:
        notes.append(f"{dark:.1%} of its samples have colours that Rec.709 has not; they were cut at 0.")
    wi, wo = _direction(theta_i, np.zeros_like(phi)), _direction(theta_o, phi)
    above = (wi[:, 2] > 1e-3) & (wo[:, 2] > 1e-3)
    if above.sum() < LEAST_SAMPLES:
        raise _refused(path, "hardly any of its directions lie above the surface")
    if not above.all():
        notes.append(f"{(~above).sum()} samples below the surface or along it were left out.")
    wi, wo, values = wi[above], wo[above], np.maximum(values[above], 0)
    side = np.sin(phi[above])
    if side.min() > -1e-3 or side.max() < 1e-3:
        off = np.abs(side) > 1e-3
        wi = np.concatenate([wi, wi[off]])
        wo = np.concatenate([wo, wo[off] * np.array([1, -1, 1])])
        values = np.concatenate([values, values[off]])
    samples = Samples(wi.astype(np.float32), wo.astype(np.float32), values, np.ones(len(values)))
    return Tabulated(samples, facts.get("name") or path.stem, tuple(notes))


def _direction(theta: F64, phi: F64) -> F64:
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def _colours(path: Path, names: list[str], values: F64, light: str, notes: list[str]) -> F64:
    """(N, 3) linear Rec.709 of the columns that are no angles."""
    upper = [name.upper() for name in names]
    if upper == ["R", "G", "B"] or upper == ["RED", "GREEN", "BLUE"]:
        return values
    if upper == ["X", "Y", "Z"]:
        return spectra.from_xyz(values, light)
    found = [_WAVELENGTH.match(name) for name in names]
    if not names or not all(found):
        odd = next((name for name, match in zip(names, found, strict=True) if not match), "")
        raise _refused(path, f"the column {odd[:30]!r} is no wavelength in nm" if odd else "it has no values")
    nm = np.array([float(match[1]) for match in found if match])
    order = np.argsort(nm)
    nm, values = nm[order], values[:, order]
    if (np.diff(nm) <= 0).any():
        raise _refused(path, "a wavelength is there twice")
    if nm[-1] < spectra.WAVELENGTHS[0] or nm[0] > spectra.WAVELENGTHS[-1]:
        raise _refused(path, f"light of {nm[0]:g} to {nm[-1]:g} nm cannot be seen")
    if len(nm) == 1:
        notes.append(f"It was measured at {nm[0]:g} nm alone and has no colour.")
    elif nm[0] > 420 or nm[-1] < 680:
        notes.append(f"It was measured from {nm[0]:g} to {nm[-1]:g} nm; beyond, its ends are taken.")
    return np.asarray(values @ spectra.rec709_weights(nm, light))
