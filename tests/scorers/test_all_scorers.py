"""What holds for every scorer."""

from __future__ import annotations

import pytest

from evplace.core import families
from evplace.scorers import Descriptor
from evplace.scorers.ncc import NCC
from evplace.scorers.network import Network
from evplace.scorers.notebook import Notebook
from evplace.testing import check_descriptor, check_scorer

TRAINED = ("network", "notebook")
MOMENT = Network(steps=2, batch=4)


@pytest.mark.parametrize("name", sorted(set(families.names("scorers")) - set(TRAINED)))
def test_each_meets_the_contract(name: str) -> None:
    part = families.make("scorers", name)
    check_descriptor(part) if isinstance(part, Descriptor) else check_scorer(part)


def test_so_do_other_settings() -> None:
    check_descriptor(NCC(sigma=0, width=8, height=5, log=True))


def test_so_do_trained_ones() -> None:
    pytest.importorskip("torch", reason="the network needs the extra 'train'")
    check_scorer(MOMENT)
    check_scorer(Notebook(batch_statistics=False, dropout=0.0, network=MOMENT))


def test_the_notebooks_habit_is_found() -> None:
    """Its answers depend on which queries are asked together."""
    pytest.importorskip("torch", reason="the network needs the extra 'train'")
    with pytest.raises(AssertionError, match="'notebook' scores an image otherwise in a batch with others"):
        check_scorer(Notebook(network=MOMENT))
