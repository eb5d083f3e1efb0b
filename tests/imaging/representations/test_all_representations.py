"""What holds for every representation."""

from __future__ import annotations

import pytest

from evplace.core import families
from evplace.testing import check_representation


@pytest.mark.parametrize("name", families.names("representations"))
def test_each_meets_the_contract(name: str) -> None:
    check_representation(families.load("representations", name))
