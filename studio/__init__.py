"""The application: composition root, command line, settings, benchmarks."""
