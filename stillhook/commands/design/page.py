"""`stillhook page`: a design in the browser, with sliders, on this machine alone."""

import argparse
import webbrowser

from models.basics import InputError

from ...text import console
from ..declare import options, within
from ..given import parse_changes

_USUAL = "subsea-crane"

ARGUMENTS = (
    options(
        f"""
        [case]  a bundled case (see `stillhook cases`) or a case file in this folder (default:
            {_USUAL})
        --set PATH=VALUE ...  change a field of the case, as in --set limits.max_sensitivity=2.5
        --port N [0]  port on 127.0.0.1; 0 for any that is free
        --no-open  do not open a browser, only print the address
        """,
        port=within(low=0, high=65535),
    ),
)
EXAMPLES = (
    ("stillhook page", "the bundled crane's design with sliders, until Ctrl-C"),
    ("stillhook page thesis-1975 --no-open", "another case; the address is printed"),
)


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C; return 0."""
    from ...page import NO_PAGE, DoorPlate, can_serve, serve_page

    if not can_serve():
        raise InputError(NO_PAGE)

    def ready(plate: DoorPlate) -> None:
        out = console()
        out.print(f"The page is at {plate.url}", soft_wrap=True)
        if not arguments.quiet:
            out.print("It is for this machine alone, and ends with Ctrl-C.", soft_wrap=True)
        if arguments.open:
            webbrowser.open(plate.url)

    serve_page(
        arguments.case or _USUAL,
        changes=parse_changes(arguments.set),
        port=arguments.port,
        ready=ready,
    )
    return 0
