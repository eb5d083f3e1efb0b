"""What the site is made of besides its pages: the notebooks, and what the commands say of themselves."""

from __future__ import annotations

import ast
import base64
import json
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from mkdocs.utils import get_relative_url

DOCS = Path(__file__).parent
SRC = DOCS.parent / "src"
COMMANDS = "<!-- the commands -->"
"""Where a page shows them."""
REMARK = re.compile(r"(\S.*?\S) {2,}(\S.*)")
"""A command, and what is said of it beside it."""
SHIM = re.compile(r'<script src="?https://unpkg.com/iframe-worker/shim"?></script>')
"""What the theme asks of another machine, so that the search works from a folder."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Each notebook as a page, beside the notebook itself."""
    for notebook in sorted((DOCS / "notebooks").glob("*.ipynb")):
        where = f"notebooks/{notebook.stem}"
        parts = [f"[Download this notebook]({notebook.name})\n"]
        for cell in json.loads(notebook.read_text("utf-8"))["cells"]:
            text = "".join(cell["source"])
            parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
            for output in cell.get("outputs", []):
                picture = output.get("data", {}).get("image/png")
                if picture is None:
                    parts.append(f"```text\n{''.join(output.get('text', []))}```" if "text" in output else "")
                    continue
                name = f"{where}-{len(parts)}.png"
                files.append(File.generated(config, name, content=base64.b64decode(picture)))
                parts.append(f"![{notebook.stem}]({Path(name).name})")
        parts[0:2] = [parts[1].partition("\n")[0], parts[0], parts[1].partition("\n")[2]]
        files.append(File.generated(config, f"{where}.md", content="\n\n".join(parts)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The commands at their place; links to notebooks lead to their pages."""
    if COMMANDS in markdown:
        markdown = markdown.replace(COMMANDS, "\n".join(map(_command, _commands())))
    return re.sub(r"(\[(?!Download).*?\]\([\w/]+)\.ipynb\)", r"\1.md)", markdown)


def on_post_page(output: str, page: Page, **_: Any) -> str:
    """The page asks no other machine for anything."""
    return SHIM.sub(f'<script src="{get_relative_url("folder-search.js", page.url)}"></script>', output)


def on_post_template(output_content: str, **_: Any) -> str:
    """The same of pages that are none of ours, such as that of what is not found."""
    return SHIM.sub("", output_content)


def _commands() -> list[Path]:
    folders = (SRC / "evplace" / "cli", SRC / "evplace_lab" / "cli")
    return sorted(
        (file for folder in folders for file in folder.glob("[a-z]*.py")), key=lambda file: file.stem
    )


def _command(file: Path) -> str:
    """A heading, the summary, the examples as they stand, and what the docstring says after them."""
    summary, _, rest = (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").partition("\n\n")
    examples, _, more = rest.removeprefix("Examples:\n").partition("\n\n")
    lines = "\n".join(REMARK.sub(r"# \2\n\1", line.removeprefix("  ")) for line in examples.splitlines())
    return f"## evplace {file.stem}\n\n{summary}\n\n```sh\n{lines}\n```\n\n{more}\n"
