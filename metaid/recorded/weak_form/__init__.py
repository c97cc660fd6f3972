"""The equations of motion of short windows: what is unknown, what solves them, and what of it is possible."""
