"""Where to try next.

A searcher proposes factors, generation by generation, and gets what became of them. `SAMPLERS` is the registry:
one more sampler is one more entry. The coordinates that searchers move in, and the sensitivity of the measure by the
nominal model, are here too.
"""

from metaid.search.bounds import at_bounds, bounds_in_force, widened
from metaid.search.cmaes import Cmaes
from metaid.search.coordinates import Coordinates, nominal_metric, plain_coordinates, prior_metric
from metaid.search.optuna_samplers import MetricSampler, candidate_space, tpe_for_metric
from metaid.search.output_error import OutputError, OutputErrorOptions
from metaid.search.registry import SAMPLERS, Sampler, SamplerOptions, make_searcher
from metaid.search.searcher import Searcher, StepOptions
from metaid.search.sensitivity import SAMPLES, arm_sensitivity, designed_speeds, sensitivity
