"""The drives by which the weights of `bayes` are fitted."""

from __future__ import annotations

from pathlib import Path

import pytest

from evplace.core.errors import SettingsError
from evplace_lab.reproduction import Choice, known


def test_settings_of_a_training_mean_nothing(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="nothing is trained for 'known': leave out steps"):
        known.document(tmp_path, Choice(train={"steps": 3}), 1, None)
