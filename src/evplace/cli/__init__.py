"""The command line: parsing and wiring, nothing else. One file a command; its name is the command's name.

Each file opens with a docstring (a summary line, then worked examples: both are its help) and holds `Args`, a
frozen dataclass whose fields are the flags, and `run(args)`, which returns the exit code: 0, or 3 where a
damaged recording's good part was used. Errors that evplace raises on purpose are one line and exit code 2.
"""

from __future__ import annotations

import _thread
import ast
import contextlib
import difflib
import errno
import importlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from evplace.cli._output import note
from evplace.core import families
from evplace.core.errors import EvplaceError, PartError

NO_OUTPUT = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
"""How the system says that nothing more can be printed."""
SIGNALED = 128
"""Added to a signal's number, this is the exit code of what it ended, as shells have it."""
AGAIN_S = 0.05
"""So long after a library passed over the wish for an end, it is asked for again."""


class _Stopped(KeyboardInterrupt):
    """The system, or whoever closes the terminal, asks for an end, as Ctrl-C does."""

    def __init__(self, number: int = signal.SIGINT) -> None:
        super().__init__()
        self.number = number


def main(argv: list[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    arguments = sys.argv[1:] if argv is None else argv
    try:
        with _stoppable():
            code = _run(arguments)
            if sys.stdout is not None:
                sys.stdout.flush()
        return code
    except EvplaceError as error:
        note(str(error))
        return 2
    except KeyboardInterrupt as stop:
        note("interrupted; nothing half-written was left")
        return SIGNALED + (stop.number if isinstance(stop, _Stopped) else signal.SIGINT)
    except BrokenPipeError:
        # The reader of our output has gone (`evplace ... | head`): that is no fault.
        _print_no_more()
        return 0
    except OSError as error:
        if error.filename is not None or error.errno not in NO_OUTPUT:
            raise
        _print_no_more()
        note(f"cannot write to standard output: {error.strerror}")
        return 2


@contextlib.contextmanager
def _stoppable() -> Iterator[None]:
    """Within the block, being asked to end is as Ctrl-C is: what was half-written goes.

    An exception in what C code calls back, such as a compiler's, goes no further: Python shows it, and the
    work goes on. There the end is asked for once more.
    """

    def stop(number: int, _: object) -> None:
        for each in numbers:  # the end is on its way: it is not asked for twice
            signal.signal(each, signal.SIG_IGN)
        raise _Stopped(number)

    def passed_over(raised: Any) -> None:
        if not isinstance(raised.exc_value, KeyboardInterrupt):
            show(raised)
            return
        number = raised.exc_value.number if isinstance(raised.exc_value, _Stopped) else signal.SIGINT
        if number in numbers:
            signal.signal(number, stop)
        threading.Timer(AGAIN_S, _thread.interrupt_main, (number,)).start()

    known = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    is_main = threading.current_thread() is threading.main_thread()
    # What nohup has it pass over is passed over.
    numbers = [number for number in known if is_main and signal.getsignal(number) is signal.SIG_DFL]
    for number in numbers:
        signal.signal(number, stop)
    show, sys.unraisablehook = sys.unraisablehook, passed_over
    try:
        yield
    finally:
        sys.unraisablehook = show
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)


def _print_no_more() -> None:
    """Let what is still to be printed vanish, as Python writes it when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def commands() -> dict[str, str]:
    """Command -> summary, read from the files without importing them."""
    return {name: _summary(module) for name, module in sorted(_modules().items())}


def _modules() -> dict[str, str]:
    """Command -> module: our own files, and the entry points of other packages."""
    own = {file.stem: f"evplace.cli.{file.stem}" for file in Path(__file__).parent.glob("[a-z]*.py")}
    return {entry.name: entry.value for entry in families.installed("evplace.commands")} | own


def _run(arguments: list[str]) -> int:
    modules = _modules()
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_overview(commands()))
        return 0
    if arguments[0] == "--version":
        from evplace import __version__

        print(f"evplace {__version__}")
        return 0
    name = arguments[0]
    if name not in modules:
        close = difflib.get_close_matches(name, modules, n=1)
        hint = f"did you mean '{close[0]}'? " if close else ""
        raise EvplaceError(f"unknown command '{name}': {hint}commands are {', '.join(sorted(modules))}")
    module = _loaded(name, modules[name])
    from evplace.cli._parse import parse

    parsed = parse(module, name, arguments[1:])
    if parsed.only_shown:
        from evplace.cli._output import print_settings

        print_settings(parsed.in_force(), parsed.args.json)
        return 0
    code: int = module.run(parsed.args)
    return code


def _overview(known: dict[str, str]) -> str:
    width = max(len(name) for name in known)
    lines = [f"  {name:<{width}}  {summary}" for name, summary in known.items()]
    return "\n".join(
        [
            "evplace: visual place recognition with event cameras",
            "",
            "usage: evplace COMMAND [OPTIONS]     evplace COMMAND --help shows worked examples",
            "",
            *lines,
        ]
    )


def _loaded(name: str, module: str) -> Any:
    try:
        return importlib.import_module(module)
    except Exception as error:
        if module.startswith("evplace"):
            raise
        raise PartError(f"the command '{name}' cannot be loaded: {type(error).__name__}: {error}") from error


def _summary(module: str) -> str:
    try:
        spec = find_spec(module)
        if spec is None or spec.origin is None:
            return "cannot be loaded"
        docstring = ast.get_docstring(ast.parse(Path(spec.origin).read_text("utf-8"))) or ""
    except (ImportError, OSError, ValueError, SyntaxError):  # another package's, which is broken
        return "cannot be loaded"
    return docstring.partition("\n")[0].rstrip(".")
