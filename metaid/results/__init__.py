"""What a study found: frames and JSON, all findings of a study at once, its model, validation, and sweeps about it.

Only here are results compared with the true lumps. Neither MuJoCo nor numba is loaded before something is simulated.
"""

from metaid.results.best import best_and_even, evenly, identified_factors
from metaid.results.body_tables import bodies_table, body_rows, describe_possible_bodies
from metaid.results.candidates import candidates, candidates_of
from metaid.results.comparison import Comparison, compare
from metaid.results.control import smooth_sinusoids, track
from metaid.results.estimates import estimate_texts
from metaid.results.findings import MODEL_ERRORS, Findings, read_findings
from metaid.results.model import identified_model, started_from
from metaid.results.overview import shown_rows, summary
from metaid.results.snapshot import Snapshot, read_snapshot, snapshot_of
from metaid.results.sweeps import Plane, Sweep, plane, sweep
from metaid.results.tables import estimate_frame, lumps_frame, studies_frame, trials_frame
from metaid.results.validation import PUSHES, Validation, validate, validate_law
from metaid.results.verdict import RESULTS, Verdict
