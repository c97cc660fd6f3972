"""What stands before the dashboard: it answers this machine's own browser alone, and what a DB says is shown, not run.

Loopback keeps other machines out, but not a page of a stranger that is open in the same browser. Such a page cannot
read from here, and may not write either: a request that says that it comes from elsewhere, or is for another host (a
name that a stranger has pointed at 127.0.0.1), is refused. Pages may run no script but the dashboard's own, and may
fetch nothing from outside, whatever a note or a graph in the DB asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

POLICY = (
    "default-src 'self'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self' data:; worker-src 'self' blob:; object-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
HEADERS = [
    ("Content-Security-Policy", POLICY),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
]

StartResponse = Callable[..., Any]
Application = Callable[[dict[str, Any], StartResponse], Iterable[bytes]]


def loopback_only(application: Application) -> Application:
    """A WSGI `application` as above, on whatever port it is served."""

    def guard(environ: dict[str, Any], start_response: StartResponse) -> Iterable[bytes]:
        hosts = {f"{name}:{environ['SERVER_PORT']}" for name in ("127.0.0.1", "localhost")}
        origin = environ.get("HTTP_ORIGIN")
        if environ.get("HTTP_HOST") not in hosts or (
            origin is not None and origin.removeprefix("http://") not in hosts
        ):
            start_response("403 Forbidden", [("Content-Type", "text/plain")])
            return [b"The dashboard is for this machine alone.\n"]

        def start(status: str, headers: list[tuple[str, str]], *more: Any) -> Any:
            return start_response(status, [*headers, *HEADERS], *more)

        return application(environ, start)

    return guard
