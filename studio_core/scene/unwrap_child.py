"""The process that cuts a mesh into charts with xatlas: one mesh on stdin, its charts on stdout.

xatlas is C++ that may abort, or take without end, on meshes that are not surfaces; so it has a process of its
own, with a memory limit where the system knows one.

The request is a line of JSON, `{"positions": P, "faces": F}`, then float32 (P, 3) and uint32 (F, 3). The
answer is `{"error": …}` or `{"vertices": V}`, then uint32 (V,) which position each vertex was, uint32 (F, 3)
faces, and float32 (V, 2) coordinates of any scale.
"""

from __future__ import annotations

import json
import os
import sys

import numpy as np

from studio_core.imaging.decode_child import limit_memory

MEGABYTES = 4096
TEXELS = 256.0
"""Of the whole mesh, along a side: charts are laid out again afterwards, so this only has to be quick."""


def main() -> None:
    """Answer one request."""
    answers = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)  # what the library prints must not mix with the answer
    limit_memory(MEGABYTES)
    said = json.loads(sys.stdin.buffer.readline())
    positions = np.frombuffer(sys.stdin.buffer.read(12 * said["positions"]), np.float32).reshape(-1, 3)
    faces = np.frombuffer(sys.stdin.buffer.read(12 * said["faces"]), np.uint32).reshape(-1, 3)
    try:
        import xatlas
    except ImportError:
        answers.write(b'{"error": "xatlas is not installed"}\n')
        return
    atlas = xatlas.Atlas()
    atlas.add_mesh(positions, faces)
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    packing.texels_per_unit = TEXELS
    packing.rotate_charts = False
    atlas.generate(charts, packing)
    vertices, corners, uvs = atlas.get_mesh(0)
    uvs = np.asarray(uvs, np.float32) * np.array([atlas.width, atlas.height], np.float32)
    answers.write(json.dumps({"vertices": len(vertices)}).encode() + b"\n")
    for array, kind in ((vertices, np.uint32), (corners, np.uint32), (uvs, np.float32)):
        answers.write(np.ascontiguousarray(array, kind).tobytes())
    answers.flush()


if __name__ == "__main__":
    main()
