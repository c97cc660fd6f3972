"""Logs as they are read, and the torques of a law where a log has none."""
