"""A plant with noise: what its sensors read is compared with a twin that is driven by what was commanded.

    estimate = fit(Readings([ReadTrial(...), ...], LogUnknowns(nominal, gravity)))

Where torques are noisy, `fit_with_torque_noise` compares `Innovations` instead: the twin is led by the readings.
`unmodelled_forces` looks in what is left of the readings for a force that the model has not.
"""

from metaid.estimation.noisy.held_out import hold_out, predicted
from metaid.estimation.noisy.innovations import Innovations
from metaid.estimation.noisy.loop import Loop
from metaid.estimation.noisy.possible import as_possible
from metaid.estimation.noisy.readings import Readings
from metaid.estimation.noisy.taken_up import explained, led, proposed_faults, take_up
from metaid.estimation.noisy.torque_noise import fit_with_torque_noise
from metaid.estimation.noisy.unmodelled import unmodelled_forces
