"""What is written of a study on its page in optuna-dashboard, in Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from metaid.frames import number_text
from metaid.results import Findings, estimate_texts, shown_rows
from metaid.show.companions import companion_name, is_long

CANDIDATES = {
    "lump": "A parameter is a factor of the nominal lump.",
    "base parameter": "A parameter is one of them, in SI units: a combination of masses, centres of mass, inertias, "
    "rotors and friction that the torque depends on.",
}
SPRINGS = {"lump": "", "base parameter": ", or swings as on the springs that its law asks for"}
FORMS = dict.fromkeys(("identified", "low", "high", "true", "error"), ".5g")  # of the numbers of a fault
LUMP_FORMS = {"nominal": ".5g", **FORMS, "error": "+.3%"}
SIGNED = "*This note is written by metaid. Take this line out to keep your own.*"


def note(found: Findings) -> str:
    """What the study is, in Markdown."""
    shown, trials, noun = found.summary, found.summary["trials"], found.sought.noun
    plant = escaped(shown["plant"])
    companion = ""
    if is_long(found):
        name = escaped(companion_name(found.name))
        companion = f"This study is long. The study *{name}* has its best trials, and others evenly spaced."
    faults = shown_rows(shown, "faults")
    fault_table = f"\n{_table(faults, 'fault', FORMS)}\n" if faults else ""
    return f"""# {escaped(found.name)}

{escaped(found.spec.study.description)}

{noun.capitalize()}s of the plant **{plant}**, searched by {shown["sampler"]} with seed {shown["seed"]}.
{CANDIDATES[noun]} The value is the measure
*{shown["measure"]}*, in {found.problem.measure.unit}; it is least where the plant coasts{SPRINGS[noun]}.

**{trials["complete"]}** trials survived. **{trials["pruned"]}** fell: they are PRUNED, their last step is the one that
they survived to, and their value ranks them behind every survivor.

{companion}

**Verdict: {shown["verdict"]}.** {escaped("; ".join(shown["reasons"]))}

{_table(shown_rows(shown), "lump", LUMP_FORMS)}
{fault_table}
{_estimate(shown)}

{SIGNED}
"""


def _estimate(shown: dict[str, Any]) -> str:
    """What all trials say together, below the lumps that a study stands by."""
    texts = estimate_texts(shown)
    said = [texts["worth"] if shown["estimate"] else escaped(texts["worth"])]  # a reason may hold a user's words
    if texts["interval"]:
        said.append(f"Low and high are the {texts['interval']}.")
    if texts["known"]:
        said.append(f"Here {texts['known']}.")
    return " ".join(said)


def _table(rows: list[dict[str, Any]], what: str, forms: Mapping[str, str]) -> str:
    """A table of lumps or of faults in Markdown, `what` the heading of their names, with a column for each of their
    numbers of which `forms` says how it is written.
    """
    lines = [f"| {' | '.join((what, *forms, 'unit'))} |", f"| --- |{' ---: |' * len(forms)} --- |"]
    for row in rows:
        numbers = [number_text(row[key], form) for key, form in forms.items()]
        lines.append(f"| `{row['name']}` | {' | '.join(numbers)} | {row['unit']} |")
    return "\n".join(lines)


def escaped(text: str) -> str:
    """A user's text with nothing left in it that Markdown or HTML would read."""
    return "".join(f"\\{letter}" if letter in "\\`*_{}[]()<>#+!|~&" else letter for letter in " ".join(text.split()))
