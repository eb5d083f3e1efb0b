"""The pages hang together: links lead somewhere, every page is reached, every part named, figures agree."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import evplace
from evplace.core import families
from made_pages import ROOT, pages

DOCS = ROOT / "docs"
OTHERS = ("ARCHITECTURE", "CHANGELOG", "CONTRIBUTING", "SECURITY", "bench/README", "ros/README")
WRITTEN = [*pages(), *(ROOT / f"{name}.md" for name in OTHERS), ROOT / "examples" / "plugin" / "README.md"]
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.MULTILINE | re.DOTALL)


def links(page: Path) -> Iterator[tuple[Path, str]]:
    """The file and the heading that each link inside the repository means."""
    for target in LINK.findall(CODE.sub("", page.read_text("utf-8"))):
        if "://" not in target:
            name, _, heading = target.partition("#")
            yield (page.parent / name).resolve() if name else page, heading


def anchors(page: Path) -> set[str]:
    """The headings of a page, as links name them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target, heading in links(page):
        assert target.exists(), f"{page.name} links to {target}, which is not there"
        assert not heading or heading in anchors(target), f"{page.name}: {target.name} has no #{heading}"


def test_every_page_is_reached() -> None:
    named = set(re.findall(r"[\w/]+\.md", (ROOT / "mkdocs.yml").read_text()))
    made = {f"notebooks/{notebook.stem}.md" for notebook in (DOCS / "notebooks").glob("*.ipynb")}
    assert named == {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")} | made


def test_readme_is_one_page() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 120


@pytest.mark.parametrize("page", ["README.md", "docs/results/index.md"])
def test_figures_are_those_of_the_tables(page: str) -> None:
    table = (DOCS / "results" / "default.md").read_text()
    rows = re.findall(
        r"^\| ((?:night|rain|day), path \d) \| (\d.*) \|$", (ROOT / page).read_text(), re.MULTILINE
    )
    assert len(rows) == 5
    for query, figures in rows:
        assert f"| {query} | live | {figures} |" in table


@pytest.mark.parametrize("family", ["readers", "writers", "tracks", "live", "datasets", "exports"])
def test_every_format_is_named(family: str) -> None:
    text = (DOCS / "formats.md").read_text()
    assert not [name for name in own(family) if f"`{name}`" not in text]


@pytest.mark.parametrize("family", ["matchers", "scorers", "datasets"])
def test_every_part_is_in_the_reference(family: str) -> None:
    text = (DOCS / "reference" / f"{family}.md").read_text()
    package = "drives.datasets" if family == "datasets" else family
    assert not [name for name in own(family) if not re.search(rf"::: evplace\.{package}\.{name}\b", text)]


def test_every_extra_is_told() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    text = (DOCS / "start.md").read_text()
    assert not [extra for extra in extras if f"`{extra}`" not in text]


def test_the_version_is_the_same_everywhere() -> None:
    version = evplace.__version__
    assert f'\nversion = "{version}"\n' in (ROOT / "pyproject.toml").read_text()
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f'\n  version: "{version}"\n' in (ROOT / "packaging" / "conda" / "recipe.yaml").read_text()
    assert f"\n## {version}" in (ROOT / "CHANGELOG.md").read_text()


def own(family: str) -> list[str]:
    """The names of our own parts."""
    return [entry.name for entry in families.entries(family) if entry.package == "evplace"]


def test_every_public_name_is_in_the_reference() -> None:
    text = (DOCS / "reference" / "index.md").read_text() + (DOCS / "reference" / "errors.md").read_text()
    elsewhere = {"__version__", "matchers", "scorers", "EvplaceError"}
    assert not [name for name in set(evplace.__all__) - elsewhere if f"::: evplace.{name}\n" not in text]
