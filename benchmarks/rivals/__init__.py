"""Published ways to identify a rig, beside metaid: what `benchmarks/peers.py` compares at equal seconds of motion.

`conditions` says what is wrong with a rig, `subjects` which chains and arms there are. `benched` is the rig, which
shares no code with metaid nor with its rivals, and is pushed by metaid. `logs` and `arm_model` record it along the
trajectories of `excitation`, under the servo of `servo`. `models` is what is believed of it. `regression`, `simulated`,
`closed_loop` and `toolbox` identify it from such a log. `judging` says how wrong each was.
"""
