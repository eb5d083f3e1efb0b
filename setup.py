"""What a package index shows of evplace: the README, without what leads to other files of the repository."""

import re
from pathlib import Path

from setuptools import setup

WITHIN = r"\[([^\]]*)\]\((?!https?:)[^)]*\)"
"""A link to another file; before a picture stands an exclamation mark."""
README = (Path(__file__).parent / "README.md").read_text("utf-8")
INDEX_NOTE = "\nThe pages and files that are named here come with the source distribution.\n"

without_pictures = re.sub(rf"^!{WITHIN}\n+", "", README, flags=re.MULTILINE)
setup(
    long_description=re.sub(WITHIN, r"\1", without_pictures) + INDEX_NOTE,
    long_description_content_type="text/markdown",
)
