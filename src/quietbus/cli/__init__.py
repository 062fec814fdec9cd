"""The ``quietbus`` command: one file for each family of commands.

Heavy modules are imported inside the commands, so that ``quietbus --help`` answers at once.
"""

from quietbus.cli import measured, papers, runs, scenarios, studies
from quietbus.cli.app import app, main

__all__ = ["app", "main", "measured", "papers", "runs", "scenarios", "studies"]
