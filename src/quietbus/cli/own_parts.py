"""Files of users that register parts of their own kinds."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from quietbus.cli.guard import BadInput


def load_parts(file: Path) -> None:
    """Run a Python file, which registers what it defines.

    Raises:
        BadInput: there is no such file, or it does not run; the message says where.
    """
    if file.suffix != ".py" or not file.is_file():
        raise BadInput(f"--parts {file}: expected a Python file (.py), got none of that name")
    name = f"parts of {file.stem}"  # no library's, whatever the file is called
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None  # of a .py file there is one
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        line = _line(error, file)
        where = f"{file}, line {line}" if line else str(file)
        raise BadInput(f"--parts {where}: {type(error).__name__}: {error}") from None


def _line(error: BaseException, file: Path) -> int | None:
    """Line of the file in which an error arose."""
    if isinstance(error, SyntaxError):
        return error.lineno
    line, trace = None, error.__traceback__
    while trace is not None:
        if Path(trace.tb_frame.f_code.co_filename).name == file.name:
            line = trace.tb_lineno
        trace = trace.tb_next
    return line
