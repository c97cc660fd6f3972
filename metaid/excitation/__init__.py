"""What to record: a motion that shows a robot's parameters best, and how well a log of it will.

`excite` finds a periodic motion, a Fourier series from rest to rest, that keeps the `Limits` of a nominal robot and is
free of contacts; `forecast` records it of the nominal robot and estimates that log.
"""

from metaid.excitation.exciting import Excitation, excite, problem_of
from metaid.excitation.files import SUFFIXES, write_motion
from metaid.excitation.forecast import LogNoise, recorded
from metaid.excitation.limits import LimitsSettings
from metaid.excitation.search import best_of_random
from metaid.excitation.series import Series, Trajectory, rest_to_rest
