"""Nominal dynamics of an arm, compiled: what the controller believes about the machine it drives.

The numbers come from MuJoCo on a model of the arm alone; this file asks for them natively and adds what MuJoCo does
not give by itself: gravity apart from Coriolis torque, Cᵀ q̇, and J̇ q̇, all exact (no differences in time).
"""

import functools

import mujoco
import numpy as np

from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import cross_into, dot, matvec_into, spd_inverse
from contactsafe.core.native import (
    full_inertia,
    mj_comPos,
    mj_comVel,
    mj_crb,
    mj_jacSite,
    mj_kinematics,
    mj_rne,
    packed_inertia,
    view1,
    view2,
)
from contactsafe.core.stack import stack_vector

_VIEWED = (
    "qpos", "qvel", "xpos", "xmat", "xipos", "site_xpos", "site_xmat", "xanchor", "xaxis", "subtree_com", "cdof_dot",
    "cvel", "cinert", "crb", "cdof",
)  # fmt: skip

handle_dtype = np.dtype(
    [
        (name, np.uintp)
        for name in ("model", "data", *_VIEWED, "body_subtreemass", "body_mass", "surface", "places", "packed_inertia")
    ]
    + [
        ("surface_points", np.int64),
        ("place_points", np.int64),  # of links and tool
        ("tool_places", np.int64),  # the last of them, the tool's
        ("site", np.int64),
        ("first_body", np.int64),
        ("tool_body", np.int64),
        ("nbody", np.int64),
        ("gravity", np.float64, (3,)),  # less what the base accelerates with
        ("base_position", np.float64, (3,)),  # of the base, world, m; where it moves
        ("base_twist", np.float64, (6,)),  # world axes, m/s and rad/s
        ("base_acceleration", np.float64, (3,)),  # m/s²
    ]
)
"""Where a compiled function finds one nominal model: addresses of MjModel, MjData and its arrays; body numbers."""


@functools.cache
def dynamics_dtype(n: int) -> np.dtype:
    """Describe what is known of an arm at one (q, q̇): the record `update_dynamics` fills, n joints."""
    f = np.float64
    return np.dtype(
        [
            ("M", f, (n, n)),  # joint inertia, kg m²
            ("M_inv", f, (n, n)),
            ("c", f, (n,)),  # Coriolis and centrifugal torque C q̇, N m
            ("g", f, (n,)),  # gravity torque, N m
            ("CT_qd", f, (n,)),  # Cᵀ q̇ with Christoffel C, N m
            ("J", f, (6, n)),  # tool Jacobian, linear rows first, world axes
            ("Jdot_qd", f, (6,)),  # J̇ q̇, m/s² and rad/s²
            ("position", f, (3,)),  # tool point, world, m
            ("rotation", f, (3, 3)),  # tool axes, world
            ("velocity", f, (6,)),  # J q̇, m/s and rad/s
            ("carried_velocity", f, (6,)),  # with which a moving base carries the tool along, m/s and rad/s
            ("carried_acceleration", f, (6,)),  # likewise, where the base does not turn, m/s² and rad/s²
            ("mass_regressor", f, (n, n + 1)),  # of `mass_regressor`, N m
        ]
    )


def make_handle(
    model: mujoco.MjModel, data: mujoco.MjData, site: str, surface: np.ndarray, places: np.ndarray
) -> np.ndarray:
    """Fill a handle for a model of one serial arm, array of one `handle_dtype` record.

    The caller keeps all that is given alive as long as the handle: of surface and places, rows as in
    `contactsafe.robot.surface`, it has the addresses.
    """
    handle = np.zeros(1, dtype=handle_dtype)
    handle["model"], handle["data"] = model._address, data._address
    for name in _VIEWED:
        handle[name] = getattr(data, name).ctypes.data
    handle["surface"], handle["surface_points"] = surface.ctypes.data, len(surface)
    handle["places"], handle["place_points"] = places.ctypes.data, len(places)
    handle["tool_places"] = np.count_nonzero(places[:, 0] == 0.0)
    handle["packed_inertia"] = packed_inertia(data)
    handle["body_mass"] = model.body_mass.ctypes.data
    handle["body_subtreemass"] = model.body_subtreemass.ctypes.data
    site_id = model.site(site).id
    handle["site"] = site_id
    handle["tool_body"] = model.site_bodyid[site_id]
    handle["first_body"] = model.jnt_bodyid[0]
    handle["nbody"] = model.nbody
    handle["gravity"] = model.opt.gravity
    return handle


@compiled
def _set_configuration(handle: Record, q: Vector) -> None:
    qpos = view1(handle.qpos, q.shape[0])
    for i in range(q.shape[0]):
        qpos[i] = q[i]
    mj_kinematics(handle.model, handle.data)
    mj_comPos(handle.model, handle.data)


@compiled(nogil=True)
def forward_kinematics(handle: Record, q: Vector, position: Vector, rotation: Matrix, J: Matrix) -> None:
    """Place the arm at q (n,) and fill the tool point (3,), its axes (3, 3) and its Jacobian (6, n)."""
    _set_configuration(handle, q)
    _tool_frame(handle, position, rotation)
    _tool_jacobian(handle, J)


@compiled
def _tool_frame(handle: Record, position: Vector, rotation: Matrix) -> None:
    site_xpos = view2(handle.site_xpos, handle.site + 1, 3)
    site_xmat = view2(handle.site_xmat, handle.site + 1, 9)
    for i in range(3):
        position[i] = site_xpos[handle.site, i]
        for j in range(3):
            rotation[i, j] = site_xmat[handle.site, 3 * i + j]


@compiled
def _tool_jacobian(handle: Record, J: Matrix) -> None:
    mj_jacSite(handle.model, handle.data, J[:3].ctypes, J[3:].ctypes, handle.site)


@compiled
def _gravity(handle: Record, n: int, g: Vector) -> None:
    """g_i = −axis_i · ((com of all beyond joint i − anchor_i) × their weight)."""
    subtree_com = view2(handle.subtree_com, handle.nbody, 3)
    subtree_mass = view1(handle.body_subtreemass, handle.nbody)
    xanchor = view2(handle.xanchor, n, 3)
    xaxis = view2(handle.xaxis, n, 3)
    arm, weight, torque = stack_vector(3), stack_vector(3), stack_vector(3)
    for i in range(n):
        body = handle.first_body + i
        for k in range(3):
            arm[k] = subtree_com[body, k] - xanchor[i, k]
            weight[k] = subtree_mass[body] * handle.gravity[k]
        cross_into(arm, weight, torque)
        g[i] = -dot(xaxis[i], torque)


@compiled
def mass_regressor(handle: Record, out: Matrix) -> None:
    """Fill the gravity torque of each joint per relative error of each link's mass, (n, n + 1), N m.

    The last column is of what the last link carries as bodies of its own: the tool. The handle must have been brought
    up to date by `update_dynamics`.
    """
    n = out.shape[0]
    com, mass = view2(handle.xipos, handle.nbody, 3), view1(handle.body_mass, handle.nbody)
    xanchor, xaxis = view2(handle.xanchor, n, 3), view2(handle.xaxis, n, 3)
    arm, weight, torque = stack_vector(3), stack_vector(3), stack_vector(3)
    out[:] = 0.0
    for body in range(handle.first_body, handle.nbody):
        link = min(body - handle.first_body, n)
        for i in range(min(link + 1, n)):
            for k in range(3):
                arm[k] = com[body, k] - xanchor[i, k]
                weight[k] = mass[body] * handle.gravity[k]
            cross_into(arm, weight, torque)
            out[i, link] -= dot(xaxis[i], torque)


@compiled
def inertia_times(cinert: Vector, v: Vector, out: Vector) -> None:
    """Add I v for MuJoCo's packed spatial inertia (xx yy zz xy xz yz, m·r, m) and twist v (angular first)."""
    xx, yy, zz, xy, xz, yz = cinert[0], cinert[1], cinert[2], cinert[3], cinert[4], cinert[5]
    rx, ry, rz, mass = cinert[6], cinert[7], cinert[8], cinert[9]
    out[0] += xx * v[0] + xy * v[1] + xz * v[2] - rz * v[4] + ry * v[5]
    out[1] += xy * v[0] + yy * v[1] + yz * v[2] + rz * v[3] - rx * v[5]
    out[2] += xz * v[0] + yz * v[1] + zz * v[2] - ry * v[3] + rx * v[4]
    out[3] += mass * v[3] + rz * v[1] - ry * v[2]
    out[4] += mass * v[4] - rz * v[0] + rx * v[2]
    out[5] += mass * v[5] + ry * v[0] - rx * v[1]


@compiled
def _coriolis_transpose(handle: Record, n: int, CT_qd: Vector) -> None:
    """(Cᵀ q̇)_i = Ṡ_i · h_i: rate of the joint's motion axis times the momentum of all beyond it.

    From Cᵀ q̇ = ½ ∂(q̇ᵀ M q̇)/∂q for Christoffel C: turning joint i carries everything beyond it rigidly, so only the
    twist that arrives from before changes, and ½ ∂(q̇ᵀ M q̇)/∂q_i = (v_i × S_i) · Σ_b≥i I_b v_b = Ṡ_i · h_i.
    """
    cvel = view2(handle.cvel, handle.nbody, 6)
    cinert = view2(handle.cinert, handle.nbody, 10)
    cdof_dot = view2(handle.cdof_dot, n, 6)
    momentum = stack_vector(6)
    momentum[:] = 0.0
    for body in range(handle.nbody - 1, handle.first_body - 1, -1):
        inertia_times(cinert[body], cvel[body], momentum)
        i = body - handle.first_body
        if i < n:
            s = 0.0
            for k in range(6):
                s += cdof_dot[i, k] * momentum[k]
            CT_qd[i] = s


@compiled
def _jacobian_rate(handle: Record, n: int, out: Vector) -> None:
    """J̇ q̇ of the tool: Σ Ṡ_i q̇_i is spatial acceleration at the arm's centre of mass; moved to the tool point."""
    cdof_dot = view2(handle.cdof_dot, n, 6)
    qvel = view1(handle.qvel, n)
    v = view2(handle.cvel, handle.nbody, 6)[handle.tool_body]
    tool = view2(handle.site_xpos, handle.site + 1, 3)[handle.site]
    centre = view2(handle.subtree_com, 2, 3)[1]
    a, r = stack_vector(6), stack_vector(3)
    a[:] = 0.0
    for i in range(n):
        for k in range(6):
            a[k] += cdof_dot[i, k] * qvel[i]
    v_point, turn, swing = stack_vector(3), stack_vector(3), stack_vector(3)
    for k in range(3):
        r[k] = tool[k] - centre[k]
    cross_into(v[:3], r, v_point)
    for k in range(3):
        v_point[k] += v[3 + k]
    cross_into(a[:3], r, turn)
    cross_into(v[:3], v_point, swing)
    for k in range(3):
        out[k] = a[3 + k] + turn[k] + swing[k]
        out[3 + k] = a[k]


@inlined
def _carry_along(handle: Record, out: Record) -> None:
    """Fill what a moving base carries the tool along with: v + ω × r, ω; its acceleration, turning left out."""
    r, swing = stack_vector(3), stack_vector(3)
    for k in range(3):
        r[k] = out.position[k] - handle.base_position[k]
    cross_into(handle.base_twist[3:], r, swing)
    for k in range(3):
        out.carried_velocity[k] = handle.base_twist[k] + swing[k]
        out.carried_velocity[3 + k] = handle.base_twist[3 + k]
        out.carried_acceleration[k] = handle.base_acceleration[k]


@compiled(nogil=True)
def update_dynamics(handle: Record, q: Vector, qd: Vector, out: Record) -> bool:
    """Fill a `dynamics_dtype` record for joint positions q (n,) rad and velocities qd (n,) rad/s.

    Returns:
        False where the inertia matrix is not positive definite (a broken model).
    """
    n = q.shape[0]
    qvel = view1(handle.qvel, n)
    for i in range(n):
        qvel[i] = qd[i]
    _set_configuration(handle, q)
    mj_comVel(handle.model, handle.data)
    mj_crb(handle.model, handle.data)
    full_inertia(handle.model, handle.data, handle.packed_inertia, out.M.ctypes)
    mj_rne(handle.model, handle.data, 0, out.c.ctypes)
    _gravity(handle, n, out.g)
    for i in range(n):
        out.c[i] -= out.g[i]
    _coriolis_transpose(handle, n, out.CT_qd)
    _tool_frame(handle, out.position, out.rotation)
    _tool_jacobian(handle, out.J)
    _jacobian_rate(handle, n, out.Jdot_qd)
    matvec_into(out.J, qd, out.velocity)
    _carry_along(handle, out)
    return spd_inverse(out.M, out.M_inv)
