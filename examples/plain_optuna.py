"""Plain Optuna: any sampler searches, and what the trials showed identifies the model anyway (docs/optuna.md).

python examples/plain_optuna.py
"""

import optuna

import metaid

optuna.logging.set_verbosity(optuna.logging.WARNING)
study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
study.optimize(metaid.objective("two-link-tpe"), n_trials=20)

falls = sum(trial.state == optuna.trial.TrialState.PRUNED for trial in study.trials)
print(f"{falls} of {len(study.trials)} trials fell; the best oscillates with {study.best_value:.3g} Hz")
print("its factors:", {name: round(factor, 2) for name, factor in study.best_params.items()})
print("what all trials say:")
print(metaid.study(study).estimate[["name", "nominal", "identified", "true", "unit"]].round(5))
