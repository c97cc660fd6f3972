"""The command line: what a user types, what is printed, and the exit status. No logic of its own.

Heavy imports wait until a command runs, so that `metaid --help` and shell completion answer at once.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from contextlib import suppress

import click

import metaid
from metaid.cli.common import Group, escape_what_has_no_code, say
from metaid.cli.interrupted import Interruption
from metaid.errors import MetaidError

EXAMPLE = """\b
Example:
  metaid estimate double-pendulum --nominal double-pendulum
  metaid study create three-link
  metaid study run three-link
  metaid study report three-link -o report.html

\b
Shell completion (or zsh_source, fish_source):
  eval "$(_METAID_COMPLETE=bash_source metaid)"
"""

# Objects that Python makes before it looks for garbage among them. Loading makes a hundred thousand that all stay; with
# Python's own 700, looking through them is a seventh of the time that `study show` takes.
LARGEST_YOUNG = 100_000


@click.group(
    cls=Group, epilog=EXAMPLE, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.version_option(metaid.__version__, prog_name="metaid")
def app() -> None:
    """Identify the dynamics of multi-link pendulums and robot arms.

    Who has a log of torques takes `estimate`. Who can push the robot takes `study`: each joint is sent the torque that
    a candidate model says would cancel gravity and Coriolis forces. Too much and it oscillates, too little and it
    falls, exactly right and it coasts.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs a command and exits: 0, or 2 with one line on stderr for anything that a user can mend, or 130 and 143
    when interrupted, or 1 when nobody reads its output any more.
    """
    escape_what_has_no_code()
    gc.set_threshold(LARGEST_YOUNG)
    interruption = Interruption()
    try:
        with interruption:
            status = app.main(arguments, standalone_mode=False, prog_name="metaid", obj=interruption)
    except click.ClickException as problem:
        _fail(problem.format_message())
    except MetaidError as problem:
        _fail(str(problem))
    except BrokenPipeError:
        _forget_output()
        sys.exit(1)  # as click and rich do themselves
    except OSError as problem:  # a full device
        _forget_output()
        _fail(f"{problem.filename or 'standard output'}: {problem.strerror}")
    except (KeyboardInterrupt, click.Abort):
        sys.exit(128 + interruption.number)
    sys.exit(status if isinstance(status, int) else 0)


def _fail(message: str) -> None:
    say(f"metaid: {' '.join(message.split())}", err=True)
    sys.exit(2)


def _forget_output() -> None:
    """Lets go of what could not be written, or Python would try once more at its end and complain."""
    with suppress(OSError, ValueError), open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


from metaid.cli import compare, episodes, excite, listing, paper, pictures, plants, recorded, results, studies  # noqa: E402  (they add commands)

for command in (plants.plant, episodes.episode, studies.study, recorded.estimate, excite.excite, paper.paper):
    app.add_command(command)
app.add_command(pictures.dashboard)
