"""What all trials of a study say together, as it is kept with the study: see `kept`.

`StudyEstimate` is that of any robot. Neither MuJoCo nor numba is loaded where it is read.
"""

from metaid.study.estimates.kept import estimate_from, keep_estimate, kept_with
from metaid.study.estimates.making import CLOSE, FIRST_TRIALS, estimate_of, shown_by_others
from metaid.study.estimates.study_estimate import StudyEstimate, interval_name
