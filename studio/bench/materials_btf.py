"""BTFs: woven cloth that is known, under 81 × 81 directions, fitted as its pictures pass by.

Rows `btf/cloth` (made as it is asked for, 8 bits, parallax), `btf/still` (the same without parallax) and
`btf/zip` (the first one as a zip file of JPEG pictures, through the command line). Each in a process of its
own, for its memory.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from studio.bench.capture_pipeline import in_child
from studio.bench.harness import Report, peak_bytes
from studio.bench.lab_btf import ClothBtf, Weave
from studio.bench.lab_btf_files import write_pictures
from studio_core.errors import LucarneError

HELD = 0.25
"""Share of the lights that is kept back, with all their pictures."""
_CHILD = "from studio.bench.materials_btf import child; child()"


def cloth(texels: int, parallax: bool) -> ClothBtf:
    """The cloth, with yarns of 16 texels each."""
    return ClothBtf(Weave(texels=texels, yarns=texels // 16, height=1.5 / texels), parallax=parallax)


def run(report: Report, program: object = None) -> None:
    """All that is asked for; `--quick`: 64² texels, without the zip file."""
    texels = 64 if report.quick else 256
    for name, parallax in (("btf/cloth", True), ("btf/still", False)):
        if report.wants(name):
            found = _in_child(texels, parallax)
            _add(report, name, found)
            report.add(name, "making_s", found["making"], "s")
    if report.wants("btf/zip") and not report.quick:
        with tempfile.TemporaryDirectory(prefix="lucarne-btf-") as folder:
            _add(report, "btf/zip", _from_files(Path(folder), texels))
    if any(row.case.startswith("btf/") for row in report.rows):
        report.notes.append(
            f"btf: nMSE over all pictures under {HELD:.0%} of the lights, which were kept back; s is the"
            " whole fit, pictures included, making_s what making them took of it."
        )
        report.keep()


def _add(report: Report, name: str, found: dict[str, Any]) -> None:
    for metric in ("holdout_nmse", "holdout_nmse_outside", "parametric_nmse", "rank"):
        report.add(name, metric, found[metric], "1")
    report.add(name, "bytes_per_texel", found["bytes_per_texel"], "B")
    report.add(name, "s", found["seconds"], "s")
    report.add(name, "cpu_s", found["cpu_seconds"], "s")
    report.add(name, "peak_bytes", found["peak_bytes"], "B")
    report.details[name] = found


def _from_files(folder: Path, texels: int) -> dict[str, Any]:
    path, told = folder / "UBO_CLOTH.zip", folder / "report.json"
    write_pictures(cloth(texels, True), path, "jpg")
    command = ["fit-material", str(path), "--holdout", str(HELD), "--report", str(told), "--quiet"]
    found: dict[str, Any] = dict(in_child(command))
    values = json.loads(told.read_text("utf-8"))
    ranks = values["fit"]["rank"]
    return {
        **found,
        **values["holdout"]["as_given"],
        "rank": float(max(ranks, key=lambda rank: ranks[rank])),
        "bytes_per_texel": values["fit"]["bytes_per_texel"],
        "basis": values["fit"]["basis"],
        "model": values["fit"]["model"],
        "file_bytes": path.stat().st_size,
    }


def _in_child(texels: int, parallax: bool) -> dict[str, Any]:
    command = [sys.executable, "-c", _CHILD, str(texels), str(int(parallax))]
    made = subprocess.run(command, capture_output=True, text=True, check=False, timeout=1800)
    if made.returncode:
        raise LucarneError(f"the fit of a BTF ended with {made.returncode}: {made.stderr[-300:]}")
    found: dict[str, Any] = json.loads(made.stdout.strip().splitlines()[-1])
    return found


def child() -> None:
    """One fit; the last line tells what it took and how well it foretells what was kept back."""

    import numpy as np

    from studio_core.parallel import Workers
    from studio_plugins.residual.btf_fit import fit_btf, lights_held

    btf = cloth(int(sys.argv[1]), sys.argv[2] == "1")
    started, used = time.perf_counter(), time.process_time()
    with Workers() as workers:
        made, errors = fit_btf(btf, held=lights_held(btf, HELD), workers=workers)
    assert errors is not None
    told = {
        "seconds": time.perf_counter() - started,
        "cpu_seconds": time.process_time() - used,
        "making": btf.making,
        "peak_bytes": peak_bytes(),
        "holdout_nmse": errors.made.whole,
        "holdout_nmse_outside": errors.made.outside,
        "parametric_nmse": errors.alone.whole,
        "rank": float(np.median(made.rank)),
        "bytes_per_texel": made.bytes_per_texel,
        "basis": made.basis.name,
        "model": made.shared.parametric.model,
        "tried": [vars(one) for one in made.tried],
    }
    print(json.dumps(told))
