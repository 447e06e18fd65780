"""Contact-safe learned manipulation: a policy moves a torque-controlled arm, and every contact stays gentle."""

from contactsafe.core import process as _process  # noqa: F401  first, for the imports below take their time; see there
from contactsafe.core import telemetry as _telemetry  # noqa: F401  before any dependency is imported

# isort: split
from contactsafe import tasks as _tasks  # noqa: F401  which Gymnasium then knows
from contactsafe.control import presets
from contactsafe.control.config import ControllerConfig
from contactsafe.control.contact_estimator import ContactEstimator
from contactsafe.control.controller import Controller
from contactsafe.control.signals import Contact, Measurement, Output, Target
from contactsafe.core.errors import ContactSafeError
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm, Pose
from contactsafe.robot.payload import Payload

__version__ = "0.1.0"

__all__ = [
    "Arm", "Contact", "ContactEstimator", "ContactSafeError", "Controller", "ControllerConfig", "Measurement", "Output",
    "Payload", "Pose", "Target", "presets", "robots",
]  # fmt: skip
