"""Bad input in short: some thousand cases of what `make soak` tries a hundred thousand of."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from soak.inputs import SEED, Workshop, check, workshop

pytestmark = pytest.mark.slow

FIRST = 1_000_000  # other cases than the soak's
COUNTS = {"plants": 500, "arms": 100, "studies": 250, "factors": 200, "arguments": 40, "databases": 20}


@pytest.fixture(scope="module")
def shop() -> Iterator[Workshop]:
    """What cases are made from."""
    with workshop() as opened:
        yield opened


@pytest.mark.parametrize("family", COUNTS)
def test_bad_input_is_refused_in_a_line_or_does_no_harm(shop: Workshop, family: str) -> None:
    """No traceback, no warning, no hang, no half-written DB, no NaN, no control character on the terminal; a failure
    names the command that does it again.
    """
    print(f"seed {SEED}, cases from {FIRST}")
    assert check(shop, family, range(FIRST, FIRST + COUNTS[family])) == []
