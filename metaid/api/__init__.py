"""metaid in Python: one call each for what the commands do."""

from metaid.api.episodes import arm_push, check_factors, episode_objective, evaluate, perturb
from metaid.api.stored import (
    Study,
    bodies,
    check,
    compare,
    load_findings,
    lumps,
    model,
    objective,
    run,
    studies,
    study,
    summary,
    trials,
    validate,
)
