"""What tests of several commands share."""

import shutil

import pytest

from contactsafe.policy.bundle import shipped_bundle


@pytest.fixture
def bundle(tmp_path):
    return shutil.copytree(shipped_bundle("wiping"), tmp_path / "bundle")
