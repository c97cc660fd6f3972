"""The study DB: an ordinary Optuna study DB on SQLite or PostgreSQL, written a generation at a time.

`Store` reads and writes trials, `Lease` lets one driver at a time run a study. Neither MuJoCo nor numba is loaded here.
"""

from metaid.store.database import DEFAULT_STORAGE, Store
from metaid.store.lease import Lease, refuse_if_run
from metaid.store.patience import SERVER_PATIENCE, keep_trying
from metaid.store.trial import ForeignTrial, Trial

__all__ = [
    "DEFAULT_STORAGE",
    "SERVER_PATIENCE",
    "ForeignTrial",
    "Lease",
    "Store",
    "Trial",
    "keep_trying",
    "refuse_if_run",
]
