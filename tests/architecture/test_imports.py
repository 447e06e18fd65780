"""What an import costs: `import contactsafe` stays light, and nothing outside training touches PyTorch."""

import importlib.metadata
import subprocess
import sys

import pytest
from packaging.requirements import Requirement

HEAVY = ("torch", "stable_baselines3", "tensorboard", "onnx", "matplotlib")
TRAINING_ONLY = ("torch", "stable_baselines3", "tensorboard", "onnx")


def loaded_by(statement: str, names: tuple[str, ...]) -> list[str]:
    """Run a statement in a fresh interpreter and tell which of the named packages it loaded."""
    code = f"{statement}\nimport sys\nprint(*[n for n in {names!r} if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_import_contactsafe_is_light():
    assert loaded_by("import contactsafe", HEAVY) == []


@pytest.mark.parametrize("module", ["contactsafe.cli", "contactsafe.policy.bundle", "contactsafe.policy.policy"])
def test_running_a_policy_does_not_import_training(module):
    assert loaded_by(f"import {module}", TRAINING_ONLY) == []


def test_making_the_environment_does_not_import_training():
    statement = 'import gymnasium, contactsafe; gymnasium.make("contactsafe/Wiping-v0").close()'
    assert loaded_by(statement, TRAINING_ONLY) == []


def test_base_install_does_not_pull_torch():
    assert not {"torch", "stable-baselines3", "tensorboard", "onnx"} & closure("contactsafe")


def closure(name: str) -> set[str]:
    """Names of all packages that installing one without extras brings."""
    found: set[str] = set()
    waiting = [(name, "")]
    while waiting:
        current, extra = waiting.pop()
        for line in importlib.metadata.requires(current) or []:
            requirement = Requirement(line)
            if requirement.marker is not None and not requirement.marker.evaluate({"extra": extra}):
                continue
            if requirement.name.lower() not in found:
                found.add(requirement.name.lower())
                waiting += [(requirement.name, extra) for extra in ("", *requirement.extras)]
    return found
