"""What is held out of logs: whole logs, or thirds of a log's motion, wherever the motion recurs.

Who excites an arm often repeats one motion. Then a third of the log is predicted by what was fitted to its repetition,
however wrong the model is of any other motion. So a third is left out of each repetition.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.weak_form.smoothed import Smoothed
from metaid.recorded.weak_form.windows import LogWindows

MOST_FOLDS = 8  # logs are held out in so many groups at most
WHOLE = 3  # so many logs or more: whole ones are held out
THIRDS = 3  # parts of a log's motion that are held out in turn
LOOKED_AT = 1500  # states that are looked for elsewhere
SAME = 0.03  # of what coordinates and speeds usually are, root mean square: a state so near is the same
PASSAGE = 1.0  # s: within it a state is near those of the same passage
MOSTLY = 0.5  # of the states: so many recur where a motion is repeated
SHORT = 0.5  # s: a shorter part belongs to the one before it
LONG = 1.0  # s: parts are no shorter in the mean, or paths cross and no motion recurs


@dataclass(frozen=True)
class Span:
    """Of one `log` the time from `begin` to `end`, in s."""

    log: int
    begin: float = -np.inf
    end: float = np.inf


@dataclass(frozen=True)
class Fold:
    """What is held out: some `spans`, which are whole logs, or a `third` of their motion, from 0 on; and whether the
    motion of another span `recurs` there.
    """

    spans: tuple[Span, ...]
    third: int | None = None
    recurs: bool = False

    @property
    def logs(self) -> tuple[int, ...]:
        """From which logs."""
        return tuple(dict.fromkeys(span.log for span in self.spans))

    def rows(self, log: int, times: Array) -> NDArray[np.bool_]:
        """Which of some `times` (...), in s, of a log are held out."""
        own = [(times >= span.begin) & (times < span.end) for span in self.spans if span.log == log]
        return np.any(own, axis=0) if own else np.zeros(times.shape, dtype=np.bool_)

    def shared(self, windows: LogWindows) -> NDArray[np.bool_]:
        """Which windows (nwindow) of a log share any time with what is held out."""
        own = [windows.overlapping(span.begin, span.end) for span in self.spans if span.log == windows.log]
        return np.any(own, axis=0) if own else np.zeros(len(windows), dtype=np.bool_)


def folds_of(logs: Sequence[Smoothed], middles: Sequence[Array]) -> tuple[Fold, ...]:
    """What is held out: whole logs where there are WHOLE or more, else thirds of each; thirds of a motion that recurs
    in what is not held out. Where a joint moves in one log alone, a third of each: else nothing would tell of the
    joint. Thirds have as many windows, by their `middles` in each log (nwindow), in s.
    """
    groups = np.array_split(np.arange(len(logs)), min(len(logs), MOST_FOLDS))
    if len(logs) > 1 and not _move_elsewhere(logs, groups):
        each = [folds_of([own], [middle]) for own, middle in zip(logs, middles, strict=True)]
        return tuple(_together(thirds) for thirds in zip(*each, strict=True))
    if len(logs) >= WHOLE:
        usual = tuple(Fold(tuple(map(Span, group.tolist()))) for group in groups)
    else:
        usual = tuple(fold for log, own in enumerate(middles) for fold in _thirds(log, own))
    return _recurring(logs, usual) or usual


def _move_elsewhere(logs: Sequence[Smoothed], groups: Sequence[NDArray[np.intp]]) -> bool:
    """Whether each joint that moves in one of the `groups` of logs does so in another, too."""
    moves = np.array([~own.held for own in logs])
    return bool((np.array([moves[group].any(axis=0) for group in groups]).sum(axis=0) > 1).all())


def _together(thirds: Sequence[Fold]) -> Fold:
    """One fold of those of each log by itself."""
    spans = tuple(replace(span, log=log) for log, fold in enumerate(thirds) for span in fold.spans)
    return Fold(spans, thirds[0].third, any(fold.recurs for fold in thirds))


def _thirds(log: int, middles: Array) -> Iterator[Fold]:
    edges = np.linspace(0, len(middles), THIRDS + 1).astype(int)[1:-1] + 1
    inner = [float(middles[min(edge, len(middles) - 1)]) for edge in edges]
    for third, (begin, end) in enumerate(zip([-np.inf, *inner], [*inner, np.inf], strict=True)):
        yield Fold((Span(log, begin, end),), third)


def _recurring(logs: Sequence[Smoothed], usual: tuple[Fold, ...]) -> tuple[Fold, ...]:
    """Thirds of the motion that recurs; none where most of what the `usual` folds hold out is nowhere else."""
    from scipy.spatial import cKDTree  # slow to load

    owners = np.concatenate([np.full(int(own.judged.sum()), log) for log, own in enumerate(logs)])
    times = np.concatenate([own.times[own.judged] for own in logs])
    states = np.concatenate([np.hstack([own.coordinates, own.speeds])[own.judged] for own in logs])
    size = states.std(axis=0)
    states = states[:, size > 0.0] / size[size > 0.0]
    reach = SAME * np.sqrt(states.shape[1])
    looked_at = np.unique(np.linspace(0, len(times) - 1, LOOKED_AT).astype(int))
    near = cKDTree(states).query_ball_point(states[looked_at], reach, return_sorted=True)
    held = np.array([sum(fold.rows(log, times) & (owners == log) for log in fold.logs) > 0 for fold in usual])
    recurs, first = np.zeros(len(looked_at), dtype=np.bool_), np.zeros(len(looked_at), dtype=np.intp)
    for number, (row, others) in enumerate(zip(looked_at.tolist(), near, strict=True)):
        elsewhere = [
            other for other in others if owners[other] != owners[row] or abs(times[other] - times[row]) > PASSAGE
        ]
        recurs[number] = any((held[:, row] & ~held[:, other]).any() for other in elsewhere)
        first[number] = min([row, *elsewhere])
    if recurs.mean() < MOSTLY:
        return ()
    is_new = first == looked_at
    third = np.minimum(THIRDS * np.searchsorted(looked_at[is_new], first, side="right") / is_new.sum(), THIRDS - 1)
    spans = _spans(owners[looked_at], times[looked_at], third.astype(int))
    if sum(own.times[-1] - own.times[0] for own in logs) < LONG * len(spans):
        return ()
    parts = [tuple(span for part, span in spans if part == number) for number in range(THIRDS)]
    return tuple(Fold(own, number, len(own) > 1) for number, own in enumerate(parts))


def _spans(owners: NDArray[np.intp], times: Array, parts: NDArray[np.intp]) -> list[tuple[int, Span]]:
    """Of states in the order of logs (nstate) the spans of each part, which end where the next begins."""
    changes = np.flatnonzero((np.diff(parts) != 0) | (np.diff(owners) != 0)) + 1
    spans: list[tuple[int, Span]] = []
    for begin, end in pairwise([0, *changes.tolist(), len(parts)]):
        log, part = int(owners[begin]), int(parts[begin])
        last = np.inf if end == len(parts) or owners[end] != log else float(times[end])
        if not spans or spans[-1][1].log != log:
            spans.append((part, Span(log, -np.inf, last)))
        elif spans[-1][0] == part or last - times[begin] < SHORT:
            spans[-1] = spans[-1][0], replace(spans[-1][1], end=last)
        else:
            spans.append((part, Span(log, float(times[begin]), last)))
    return spans
