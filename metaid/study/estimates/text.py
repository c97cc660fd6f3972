"""An estimate as a text in the DB: exact, compact, and read without pickle.

The text is JSON, compressed, in base64. An array is its type, its shape and its numbers in base64; one of the classes
that are KEPT is its name and its fields; a sequence is a tuple when it is read.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from metaid.estimation import (
    ArmEstimate,
    BaseUnknowns,
    Estimate,
    FoundFaults,
    HeldOutPushes,
    LogUnknowns,
    Prediction,
    Proposal,
    SearchedFaults,
    TakenUp,
    Unmodelled,
)
from metaid.study.estimates.study_estimate import StudyEstimate

_OF_ESTIMATE = StudyEstimate, Estimate, ArmEstimate, FoundFaults, SearchedFaults
_SAID_OF_IT = TakenUp, Proposal, Unmodelled, HeldOutPushes, Prediction
KEPT: dict[str, Any] = {one.__name__: one for one in (*_OF_ESTIMATE, *_SAID_OF_IT)}
LARGEST = 500_000_000  # bytes of JSON: a text that claims more was not written by metaid


def text_of(value: Any) -> str:
    """The text of a `value`. Of what follows from the study and its trials it has the names alone."""
    text = json.dumps(_plain(value), separators=(",", ":"))
    return base64.b64encode(zlib.compress(text.encode())).decode("ascii")


def value_of(text: str, given: Mapping[str, Any]) -> Any:
    """What a `text` holds, with what is `given` in its places.  Raises ValueError, TypeError, LookupError or
    AttributeError where it holds nothing.
    """
    try:
        plain = zlib.decompressobj().decompress(base64.b64decode(text, validate=True), LARGEST)
    except zlib.error as problem:
        raise ValueError("not compressed") from problem
    return _value(json.loads(plain), given)


def _plain(value: Any) -> Any:
    if callable(value):
        return {"given": "seen"}  # of a `StudyEstimate`
    if isinstance(value, LogUnknowns | BaseUnknowns):
        return {"given": "searched"}  # of an estimate
    if isinstance(value, np.ndarray):
        numbers = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode("ascii")
        return {"kind": value.dtype.str, "shape": value.shape, "array": numbers}
    if is_dataclass(value):
        own = {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
        return {"class": type(value).__name__, "fields": own}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    return value.item() if isinstance(value, np.generic) else value


def _value(plain: Any, given: Mapping[str, Any]) -> Any:
    if isinstance(plain, list):
        return tuple(_value(each, given) for each in plain)
    if not isinstance(plain, dict):
        return plain
    if "given" in plain:
        return given[plain["given"]]
    if "array" in plain:
        numbers = np.frombuffer(base64.b64decode(plain["array"], validate=True), np.dtype(plain["kind"]))
        return numbers.reshape(plain["shape"]).copy()
    return KEPT[plain["class"]](**{name: _value(each, given) for name, each in plain["fields"].items()})
