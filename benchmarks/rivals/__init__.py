"""Published ways to identify a chain, beside metaid: what `benchmarks/peers.py` compares at equal seconds of motion.

`conditions` says what is wrong with a rig. `logs` records it along the trajectories of `excitation`, under the servo of
`servo`. `regression`, `simulated`, `closed_loop` and `toolbox` identify it from such a log, and `pushed` by pushes,
with metaid. `judging` says how wrong each was.
"""
