"""Checks that hold a part, of this package or of another, to what its family promises.

Each is a plain function for the tests of a package that adds a part: it raises AssertionError with a sentence
that says what is broken, and returns nothing where all is well. They need numpy and the package itself.
"""

from __future__ import annotations

from evplace.testing._datasets import check_dataset
from evplace.testing._live import check_live
from evplace.testing._matchers import check_matcher
from evplace.testing._readers import check_reader
from evplace.testing._representations import check_representation
from evplace.testing._scorers import check_descriptor, check_scorer

__all__ = [
    "check_dataset",
    "check_descriptor",
    "check_live",
    "check_matcher",
    "check_reader",
    "check_representation",
    "check_scorer",
]
