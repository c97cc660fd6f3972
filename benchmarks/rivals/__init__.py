"""Published ways to identify a rig, beside metaid: what `benchmarks/peers.py` compares at equal seconds of motion.

`conditions` says what is wrong with a rig, `subjects` which chains and arms there are. `logs` and `arm_model` record
them along the trajectories of `excitation`, under the servo of `servo`. `models` is what is believed of them.
`regression`, `simulated`, `closed_loop` and `toolbox` identify them from such a log, and `pushed` and `pushed_arm` by
pushes, with metaid. `benched` records and pushes a chain that shares no code with metaid. `judging` says how wrong each
was.
"""
