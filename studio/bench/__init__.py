"""Benchmarks and stress runs: `lucarne bench NAME`, `lucarne stress NAME`."""

from studio.bench.run import run

__all__ = ["run"]
