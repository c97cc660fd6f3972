"""Whether a change of the code has left every trial of every shipped study as it was, bit for bit.

python -m soak.tables FILE.json

The first call runs the shipped studies and writes a digest of each trial table into FILE.json. Later calls run them
again and name each study whose digest is another; exit status 1 if there is one. Each is run on one worker and on two,
which has to make no difference. Digests are of one machine: another processor or BLAS may round differently.
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
from pathlib import Path

import metaid
from metaid.files import shipped_names

WORKERS = 1, 2


def digest(study: str, storage: str, workers: int) -> str:
    """A digest of the trial table of a shipped study, run afresh on so many `workers`."""
    metaid.run(study, storage=storage, workers=workers)
    trials = metaid.trials(study, storage=storage)
    # The text of a float is its shortest one that reads back as the same bits.
    table = json.dumps(trials.astype({"state": str}).to_dict("list"), sort_keys=True)
    return hashlib.sha256(table.encode()).hexdigest()


def main() -> None:
    """Writes the digests, or compares with those that are written."""
    if len(sys.argv) != 2:
        sys.exit("usage: python -m soak.tables FILE.json")
    path = Path(sys.argv[1])
    found, differ = dict[str, str](), list[str]()
    with tempfile.TemporaryDirectory() as folder:
        for study in shipped_names("studies"):
            digests = {digest(study, f"{folder}/{study}-{workers}.db", workers) for workers in WORKERS}
            found[study] = min(digests)
            differ += [study] if len(digests) > 1 else []
    if differ:
        sys.exit("\n".join(f"{study}: another trial table on two workers" for study in differ))
    if not path.exists():
        path.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
        print(f"{len(found)} digests are in {path}")
        return
    known = json.loads(path.read_text(encoding="utf-8"))
    changed = [study for study, value in found.items() if known.get(study, value) != value]
    print("\n".join(f"{study}: another trial table" for study in changed) or "all trial tables are the same")
    sys.exit(1 if changed else 0)


if __name__ == "__main__":
    main()
