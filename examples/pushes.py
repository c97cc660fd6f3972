"""From pushes to a model: a simulated pendulum with noisy encoders, and no torque sensor (docs/tutorial.md).

python examples/pushes.py
"""

import metaid

lumps = metaid.run("noisy-three-link", storage="metaid.db")  # run again it goes on, or answers at once
print(lumps[["name", "nominal", "identified", "low", "high", "true", "unit"]].round(5))
print(metaid.summary("noisy-three-link", "metaid.db")["verdict"])

model = metaid.model("noisy-three-link", "metaid.db")
print("torque that holds it bent:", model.torque([0.3, -0.2, 0.1], [0.0, 0.0, 0.0]).round(3), "N m")

validation = metaid.validate("noisy-three-link", "metaid.db")
for row in validation.summary()["models"]:
    print(f"with the {row['model']} model it coasts for {row['coasting_s']:.3g} s after a new push")
