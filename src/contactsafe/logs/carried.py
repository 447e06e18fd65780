"""What the tool carries, as far as a file can hold it: decided first, and all else is identified with exactly it."""

from typing import NamedTuple

import numpy as np

from contactsafe.logs.fitting import Fit
from contactsafe.robot.arm import Arm
from contactsafe.robot.calibrated import can_carry
from contactsafe.robot.description import Inertia
from contactsafe.robot.payload import Payload
from contactsafe.robot.regressor import PARAMETERS, inertia_of, parameters_of, site_in_link

_SURE = 3.0
"""Standard deviations by which a payload's mass must be other than zero."""

_FAR_M = 1.0
"""From the tool point, beyond which nothing is that a tool carries: a wrong mass was found."""


class Carried(NamedTuple):
    """The payload that a fit shows.

    Attributes:
        payload: in the tool's frame; None where there is none to speak of.
        deviation: of its mass, standard deviation, kg.
        left_out: why not all that the fit shows is part of it; empty where all is.
    """

    payload: Payload | None
    deviation: float = 0.0
    left_out: str = ""

    def parameters(self, arm: Arm) -> np.ndarray:
        """Return its inertial parameters in the frame of the arm's last link, (10,); zeros for no payload."""
        if self.payload is None:
            return np.zeros(PARAMETERS)
        (R, origin), (kg, com, inertia) = site_in_link(arm), self.payload
        return parameters_of(Inertia.of(kg, origin + R @ com, R @ inertia @ R.T))


def carried_by(found: Fit, arm: Arm) -> Carried:
    """Return the payload that a fit shows."""
    if not found.unknowns.load:
        return Carried(None)
    kg, deviation = float(found.of("load")[0]), float(found.deviation("load")[0])
    said = f"a payload of {kg:.2g} kg was left out"
    if not abs(kg) >= _SURE * deviation:
        return Carried(None, deviation, f"{said}: its mass is known to ± {deviation:.2g} kg only")
    load, (R, origin) = inertia_of(found.of("load")), site_in_link(arm)
    com, inertia = R.T @ (np.array(load.com) - origin), R.T @ load.matrix() @ R
    away = float(np.linalg.norm(com))
    if away > _FAR_M:
        return Carried(None, deviation, f"{said}: it would be {away:.2g} m from the tool point")
    whole, point = Payload(kg, com, inertia), Payload(kg, com, np.zeros((3, 3)))
    if can_carry(arm, whole) and (kg < 0.0 or np.linalg.eigvalsh(inertia)[0] >= 0.0):
        return Carried(whole, deviation)
    if can_carry(arm, point):
        said = f"the payload of {kg:.2g} kg counts as a point: no body has the inertia that was found about its centre"
        return Carried(point, deviation, said)
    return Carried(None, deviation, f"{said}: no body would be left of the last link")
