"""Long runs that show what metaid promises of its reliability: `make soak`."""
