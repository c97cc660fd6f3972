"""A study: its file, what follows from that before any trial, and how it is created, run, resumed and checked.

`StudySpec` is all that a run depends on, `Problem` what follows from it, `run_study` goes through the trials.
"""

import sys

import metaid
from metaid.study.checking import Stepping, check, stepping
from metaid.study.create import (
    advice,
    create_study,
    delete_study,
    ensure_study,
    optuna_spec,
    question,
    refuse_what_cannot_be_run,
    stored_spec,
)
from metaid.study.drawn import drawn_nominal
from metaid.study.evaluation import NominalMetricSampler, OptunaObjective
from metaid.study.forecast import Forecast, forecast, refuse_until
from metaid.study.identifiability import Identifiability, identifiability, identifiability_by_measure
from metaid.study.loading import (
    load_study,
    problem_of,
    with_nominal,
)
from metaid.study.parameters import Known, Parameters
from metaid.study.problem import MOST_TRIALS, Problem
from metaid.study.progress import Progress
from metaid.study.pushing import COUNTING_STEPS, HORIZON, TIP_SPEED
from metaid.study.run import ARITHMETIC_KEY, ENDED_KEY, arithmetic, run_study
from metaid.study.settings import (
    DrawnNominalSettings,
    EpisodeSettings,
    EstimateSettings,
    NominalSettings,
    SearchSettings,
    StudySettings,
)
from metaid.study.spec import StudySpec, TreeSettings

sys.modules[__name__].__class__ = metaid.CallableStudy
