"""A study: its file, what follows from that before any trial, and how it is created, run, resumed and checked.

`StudySpec` is all that a run depends on, `Problem` what follows from it, `run_study` goes through the trials.
"""

from metaid.study.bounds import LumpAtBound, lumps_at_bounds
from metaid.study.create import advice, create_study, delete_study, ensure_study, optuna_spec, question, stored_spec
from metaid.study.evaluation import NominalMetricSampler, OptunaObjective
from metaid.study.identifiability import COARSEST, identifiability, identifiability_by_measure
from metaid.study.problem import MOST_TRIALS, Problem, load_study
from metaid.study.progress import Progress
from metaid.study.pushing import COUNTING_STEPS, HORIZON, TIP_SPEED
from metaid.study.run import ARITHMETIC_KEY, ENDED_KEY, arithmetic, run_study
from metaid.study.settings import EpisodeSettings, SearchSettings, StudySettings, StudySpec

__all__ = [
    "ARITHMETIC_KEY",
    "COARSEST",
    "COUNTING_STEPS",
    "ENDED_KEY",
    "HORIZON",
    "MOST_TRIALS",
    "TIP_SPEED",
    "EpisodeSettings",
    "LumpAtBound",
    "NominalMetricSampler",
    "OptunaObjective",
    "Problem",
    "Progress",
    "SearchSettings",
    "StudySettings",
    "StudySpec",
    "advice",
    "arithmetic",
    "create_study",
    "delete_study",
    "ensure_study",
    "identifiability",
    "identifiability_by_measure",
    "load_study",
    "lumps_at_bounds",
    "optuna_spec",
    "question",
    "run_study",
    "stored_spec",
]
