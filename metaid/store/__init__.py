"""The study DB: an ordinary Optuna study DB on SQLite or PostgreSQL, written a generation at a time.

`Store` reads and writes trials, `Lease` lets one driver at a time run a study. Neither MuJoCo nor numba is loaded here.
"""

from metaid.store.database import COMPANION, DEFAULT_STORAGE, SPEC_KEY, Store, study_attributes
from metaid.store.lease import Lease, refuse_if_run
from metaid.store.ownership import EXPERIMENT
from metaid.store.rows import MOTION_KEYS, outcome_attributes, shown_trial
from metaid.store.trial import ForeignTrial, Trial
