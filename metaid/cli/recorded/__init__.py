"""`metaid estimate`: what a rig's log says of it."""

from metaid.cli.recorded.command import estimate
