"""The decoder child: reads requests from stdin, answers with pixels on stdout.

A request is a line of JSON, `{"path": …}`, with `"photograph": true` for the encoded numbers of one, with
`"plain": true` for numbers that are no colours. The answer is a line of JSON, either `{"error": …}` or
`{"shape": …, "dtype": …, "facts": …}`, and then the raw pixels. The process has a memory limit where the
system knows one, writes nothing and has no state between requests.
"""

from __future__ import annotations

import dataclasses
import json
import os
import sys

import numpy as np

from studio_core.imaging.decode import Limits, Unreadable, decode_file
from studio_core.imaging.photograph_decode import decode_photograph


def limit_memory(megabytes: int) -> None:
    """Make allocations beyond `megabytes` fail, and dump no core (POSIX)."""
    try:
        import resource
    except ImportError:
        return
    for what, most in ((resource.RLIMIT_AS, megabytes << 20), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(what)[1]
        if hard != resource.RLIM_INFINITY:
            most = min(most, hard)
        try:
            resource.setrlimit(what, (most, hard))
        except (ValueError, OSError):  # a system that does not allow it
            continue


def main(pixels: int, megabytes: int) -> None:
    """Serve until stdin ends."""
    answers = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)  # what a library prints must not mix with the answers
    limits = Limits(pixels, megabytes)
    limit_memory(3 * megabytes + 2048)
    for line in sys.stdin.buffer:
        data = None
        try:
            request = json.loads(line)
            if request.get("photograph"):
                made, facts = decode_photograph(request["path"], limits)
            else:
                made, facts = decode_file(request["path"], limits, plain=bool(request.get("plain")))
            answer = {
                "shape": made.shape,
                "dtype": str(made.dtype),
                "facts": dataclasses.asdict(facts),
            }
            data = np.ascontiguousarray(made)
        except Unreadable as error:
            answer = {"error": str(error)}
        except MemoryError:
            answer = {"error": "decoding it needs more memory than is allowed"}
        except Exception as error:  # whatever a damaged file provokes is that file's failure
            answer = {"error": f"decoding failed ({type(error).__name__}: {error})"}
        answers.write(json.dumps(answer).encode() + b"\n")
        if data is not None:
            answers.write(data.data)
        answers.flush()
        del data
