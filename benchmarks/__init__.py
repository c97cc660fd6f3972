"""What metaid costs and how it compares: each module is one command, `python -m benchmarks.NAME`."""
