"""``tyndall report``: one HTML page from results that were saved before."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tyndall.app import console


def report(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of `tyndall compare` or `tyndall sweep`, or one of several.")
    ],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print where the page is as JSON on stdout, and nothing else there.")
    ] = False,
) -> None:
    """Write report.html into a folder of results: pictures, errors, time and memory on one page, from disk."""
    with console.Work("writing the report"):
        from tyndall.lab.report import write_report

        page = write_report(folder)
    print(json.dumps({"report": str(page)}, indent=2) if as_json else f"the report is {page}")
