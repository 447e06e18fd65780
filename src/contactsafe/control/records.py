"""State is data: everything a controller is made of, as nested NumPy records that compiled code reads by name.

One controller is one record of `controller_dtype(n)`; many are an array of them; its state is saved by copying it. What
a stage remembers is described in the stage's own file.
"""

import functools

import numpy as np

from contactsafe.control.baseline import baseline_dtype
from contactsafe.control.classification import classification_dtype
from contactsafe.control.clock import clock_dtype
from contactsafe.control.codes import FREE, NO_CONTACT, REJECT, TOOL
from contactsafe.control.contact_work import contact_work_dtype
from contactsafe.control.detection import detection_dtype
from contactsafe.control.impedance import impedance_dtype
from contactsafe.control.isolation import isolation_dtype
from contactsafe.control.limits import limits_dtype
from contactsafe.control.link_masses import link_masses_dtype
from contactsafe.control.localisation import localisation_dtype
from contactsafe.control.observer import observer_dtype
from contactsafe.control.params import params_dtype, step_dtype
from contactsafe.control.payload import known_payload_dtype, payload_dtype
from contactsafe.control.reaction import reaction_dtype
from contactsafe.control.tool_wrench import tool_wrench_dtype
from contactsafe.control.touch import touch_dtype
from contactsafe.robot.dynamics import dynamics_dtype, handle_dtype

_f = np.float64
_i = np.int64


def measurement_dtype(n: int) -> np.dtype:
    """Describe what sensors give each tick."""
    return np.dtype(
        [
            ("q", _f, (n,)),  # rad
            ("qd", _f, (n,)),  # rad/s
            ("wrench_ee", _f, (6,)),  # environment on end effector, at the tool point, world axes, N and N m
            ("has_wrench", _i),  # 0 where no force sensor is there
            ("time", _f),  # when it was measured, s
            ("has_time", _i),  # 0 where that is not known
            ("torque", _f, (n,)),  # at the joints, behind the gears, N m
            ("has_torque", _i),  # 0 where no sensor says it
        ]
    )


def target_dtype(n: int) -> np.dtype:
    """Describe what a policy asks for."""
    return np.dtype(
        [
            ("position", _f, (3,)),  # m
            ("quat", _f, (4,)),  # w x y z
            ("K_task", _f, (6,)),  # 1/s²
            ("D_task", _f, (6,)),  # 1/s
            ("q_posture", _f, (n,)),  # rad
            ("kept", _i),  # 1 in a tick for which no new one came
        ]
    )


def arm_state_dtype(n: int) -> np.dtype:
    """Describe where the arm is believed to be: as measured, or as predicted where that failed."""
    return np.dtype(
        [
            ("q", _f, (n,)),  # rad
            ("qd", _f, (n,)),  # rad/s
            ("wrench_ee", _f, (6,)),  # last good one
            ("has_wrench", _i),
            ("torque", _f, (n,)),  # last good one, N m
            ("has_torque", _i),
        ]
    )


def command_dtype(n: int) -> np.dtype:
    """Describe the command last sent."""
    return np.dtype(
        [
            ("tau", _f, (n,)),  # N m
            ("friction", _f, (n,)),  # friction torque contained in it, N m
        ]
    )


def state_dtype(n: int) -> np.dtype:
    """Describe what a controller remembers from tick to tick, stage by stage."""
    return np.dtype(
        [
            ("started", _i),  # 0 before the first tick after a reset
            ("turn", _i),  # joint whose torque masses are identified from next
            ("mode", _i),  # FREE, COMPLY or REJECT
            ("fault", _i),  # first since reset, or what replaced it; see codes.FAULTS
            ("arm", arm_state_dtype(n)),
            ("target", target_dtype(n)),  # last good one
            ("command", command_dtype(n)),
            ("step", step_dtype),  # what gains come to over the time that passed
            ("clock", clock_dtype(n)),
            ("observer", observer_dtype(n)),
            ("detection", detection_dtype(n)),
            ("isolation", isolation_dtype(n)),
            ("tool_wrench", tool_wrench_dtype(n)),
            ("baseline", baseline_dtype(n)),
            ("touch", touch_dtype(n)),
            ("localisation", localisation_dtype(n)),
            ("link_masses", link_masses_dtype(n)),
            ("payload", payload_dtype),
            ("classification", classification_dtype(n)),
            ("contact_work", contact_work_dtype(n)),
            ("reaction", reaction_dtype),
            ("impedance", impedance_dtype(n)),
            ("limits", limits_dtype(n)),
        ]
    )


def output_dtype(n: int) -> np.dtype:
    """Describe what a tick reports."""
    return np.dtype(
        [
            ("torque", _f, (n,)),  # command, N m
            ("residual", _f, (n,)),  # compensating, N m
            ("residual_fast", _f, (n,)),  # N m
            ("error", _f, (6,)),  # x_d − x, m and rad
            ("position", _f, (3,)),  # of the tool, m
            ("rotation", _f, (3, 3)),
            ("velocity", _f, (6,)),  # of the tool
            ("mode", _i),  # FREE, COMPLY or REJECT
            ("kind", _i),  # key of KINDS
            ("link", _i),  # that the law in force complies with or rejects a contact of, 1 … n, 0 for none
            ("touched", _i),  # link, most probably, that the point is on, 1 … n, 0 where there is none
            ("probability", _f),  # of the kind
            ("several", _i),  # whether no single contact explains the torques
            *(
                (name, _f, (3,)) for name in ("point", "force")
            ),  # where, m, and what is there, N; world; 0 where `touched` is
            ("contact_command_nm", _f),  # commanded torque against the contact before it is bounded, N m
            ("contact_limit_nm", _f),  # the bound in force; inf where there is none
            ("limited_by", _i),  # sum of the keys of LIMITS that took something off the command
            ("bridged", _i),  # ticks in a row whose measurement was predicted
            ("target_late", _i),  # 1 where no new target came for too long
            ("braked", _i),  # 1 where the arm is braked, until reset
            ("fault", _i),
        ]
    )


@functools.cache  # numba compares types of records that are not the very same field by field, 10 us a call
def controller_dtype(n: int) -> np.dtype:
    """Describe one whole controller for an arm of n joints."""
    return np.dtype(
        [
            ("handle", handle_dtype),
            ("params", params_dtype(n)),
            ("payload", known_payload_dtype),
            ("state", state_dtype(n)),
            ("measurement", measurement_dtype(n)),
            ("target", target_dtype(n)),
            ("dynamics", dynamics_dtype(n)),
            ("output", output_dtype(n)),
        ],
        align=True,
    )


def index_bounds(controller: np.void) -> dict[str, tuple[float, float]]:
    """Return by name what those integers of a `controller_dtype` record may be that compiled code indexes with."""
    n, handle = len(controller["output"]["torque"]), controller["handle"]
    points, places = int(handle["surface_points"]), int(handle["place_points"])
    return {
        "state.turn": (0, n - 1),
        "state.mode": (FREE, REJECT),
        "state.isolation.link": (0, n),
        "state.isolation.search_at": (0, max(points - 1, 0)),
        "state.isolation.search_point": (-1, points - 1),
        "state.localisation.next": (0, max(places - 1, 0)),
        "state.localisation.best": (-1, places - 1),
        "state.localisation.link": (0, n + 1),
        "output.mode": (FREE, REJECT),
        "output.kind": (NO_CONTACT, TOOL),
        "output.link": (0, n),
        "output.touched": (0, n),
    }
