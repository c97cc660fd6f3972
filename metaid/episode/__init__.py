"""The perturb-and-count episode: pushes, the loop step by step, what it shows, and the measures of that.

`Episode` says what is done to a plant, `run_stepwise` does it on any plant, and `Record` is what was seen. A planar
chain and an arm differ in the `kind` of the episode alone. A measure turns a record into one number. An `Outcome` is
what a searcher gets. No storage and no sampler.
"""

from metaid.episode.episode import Episode, Spatial, arm_episode
from metaid.episode.falls import FALL_LIMIT, FALL_MARGIN, RICH_FALL_LIMIT, RICH_RUNAWAY, FallRule
from metaid.episode.measures import (
    MEASURES,
    NOISE_RESOLUTION,
    Measure,
    crossing_hz,
    fall_value,
    get_measure,
    spectral_hz,
    whole_periods,
)
from metaid.episode.outcome import FALL_VALUE, Outcome, failure
from metaid.episode.plausible import Calibration, KnownStarts, elsewhere
from metaid.episode.pushes import REACH, natural_time, pushed_speeds, pushes_for, rich_pushes, rich_speeds, tip_push
from metaid.episode.readings import SensorReadings, readings_before_fall
from metaid.episode.record import GoesOn, Record, States, energies, same_record
from metaid.episode.smoothing import NoiseFloor, noise_floor
from metaid.episode.stepwise import StepwiseLoop, WholeEpisodes, noise_of, record_of, run_stepwise, with_deadband
from metaid.episode.windows import (
    QUANTITIES,
    SHORTEST,
    WINDOWS,
    Windows,
    even_ends,
    window_ends,
    windows_before_fall,
)
