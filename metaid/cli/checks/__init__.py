"""What is known of a study before any trial, as `metaid study check` prints it; see `determined`, which loads more."""

from typing import Any

from metaid.cli.checks.until import describe_forecast, describe_reached, share

__all__ = ["describe_forecast", "describe_reached", "print_check", "share"]


def __getattr__(name: str) -> Any:
    if name == "print_check":  # loads what reads studies
        from metaid.cli.checks.determined import print_check

        return print_check
    raise AttributeError(f"module 'metaid.cli.checks' has no attribute '{name}'")
