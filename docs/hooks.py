"""What the site's pages take from the code: the commands' summaries and examples."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

SRC = Path(__file__).parents[1] / "src"
PLACE = "<!-- the commands -->"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """A page with the commands at the place that is marked for them."""
    return markdown.replace(PLACE, "\n".join(map(_command, _files()))) if PLACE in markdown else markdown


def _files() -> list[Path]:
    folders = (SRC / "evplace" / "cli", SRC / "evplace_lab" / "cli")
    return sorted((file for folder in folders for file in folder.glob("[a-z]*.py")), key=lambda file: file.stem)


def _command(file: Path) -> str:
    """A heading, the summary, the examples as they stand, and what the docstring says after them."""
    summary, _, rest = (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").partition("\n\n")
    examples, _, more = rest.removeprefix("Examples:\n").partition("\n\n")
    lines = "\n".join(line.removeprefix("  ") for line in examples.splitlines())
    return f"## evplace {file.stem}\n\n{summary}\n\n```sh\n{lines}\n```\n\n{more}\n"
