"""Matching whole counts: the models that count exactly as many half periods as the plant, in every window.

    estimate = match_counts(Counts(trials, LogUnknowns(nominal, gravity)))

A count is an integer. What it is made of, the phase of each joint and its extrema beside the upright, is smooth in the
lumps (`metaid.estimation.count_crossings`). So a model with the right counts is found by descents and linear
programmes, and not by chance.
"""

from metaid.paper.counting.counts import Counts
from metaid.paper.counting.matching import CountedExperiment, match_counts
from metaid.paper.counting.programme import pairs
