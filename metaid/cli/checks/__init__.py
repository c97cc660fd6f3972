"""What is known of a study before any trial, as `metaid study check` prints it."""

from metaid.cli.checks.arm_check import check_arm
from metaid.cli.checks.until import describe_forecast, describe_reached, forecast_row, share

__all__ = ["check_arm", "describe_forecast", "describe_reached", "forecast_row", "share"]
