"""What keeps a command within bounds, whatever is asked: gains, power, joint range and speed, torque and its rate."""

import math

from contactsafe.control.damping import joint_damping_limits
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matvec_into, spd_inverse
from contactsafe.core.stack import stack_matrix, stack_vector

_STILL = 1e-12
"""Twice the energy of an arm that stands still, J: no torque gives it any power worth the name."""

_RELEASE_RAD_S2 = 100.0
"""Acceleration by which a joint may be let go when its own torque is taken off, rad/s²."""

_FADE_RAD_S = 0.4
"""Excess of speed at which nothing pushes a joint on any more, rad/s."""

_ASTRAY_RAD_S2 = 50.0
"""By how much a joint may accelerate otherwise than asked where others are clipped, rad/s²: no heavy one does."""

_SWEEPS = 6
"""Over all joints, in search of the least constraint; on arms of all kinds more change nothing that matters."""


@compiled
def passive_step(K, D, K_wanted, D_wanted, dt, damping_min, limited):
    """Move stiffness and damping in place towards what is wanted, no faster than keeps the impedance stable.

    Unit inertia, stiffness K, damping D ≥ α: K̇ + α Ḋ ≤ 2 α K suffices (Kronander & Billard 2016, eq. 12), each axis by
    itself. Falling gains are free.

    Args:
        K, D: in force, (6,), 1/s² and 1/s; updated.
        K_wanted, D_wanted: (6,).
        dt: tick, s.
        damping_min: α, least damping that may ever be asked for, 1/s.
        limited: whether to limit at all.
    """
    for i in range(6):
        way = K_wanted[i] - K[i] + damping_min * (D_wanted[i] - D[i])
        most = 2.0 * damping_min * K[i] * dt
        share = most / way if limited and way > most else 1.0
        K[i] += share * (K_wanted[i] - K[i])
        D[i] += share * (D_wanted[i] - D[i])


@compiled
def power_limit(tau_net, M, qd, tank, power, drain_s):
    """Damp a command in place so that it gives the arm no more power than a tank of energy can pay.

    The tank is filled with a steady power and by what the command takes out of the arm. Its level falls no faster than
    level/drain_s beyond that power; what is taken off brakes all joints alike, along M q̇: it turns no light joint back.

    Args:
        tau_net: command less gravity and Coriolis torque, (n,), N m; updated.
        M: joint inertia, (n, n), kg m².
        qd: (n,), rad/s.
        tank: level, J.
        power: steady, W.
        drain_s: s.

    Returns:
        True where anything was taken off.
    """
    allowed = power + max(tank, 0.0) / drain_s
    given = dot(tau_net, qd)
    if given <= allowed:
        return False
    momentum = matvec_into(M, qd, stack_vector(qd.shape[0]))
    energy = dot(momentum, qd)
    if energy <= _STILL:
        return False
    for i in range(qd.shape[0]):
        tau_net[i] -= (given - allowed) / energy * momentum[i]
    return True


@compiled
def predict_velocity(qd, M_inv, momentum_rate, step_max, dt, speed, ahead):
    """Fill the speed that joints will have before the torque that drives them can be taken off, and when that is.

    A command falls by `step_max` a tick at most: until it is gone it goes on accelerating, by half of it on average.

    Args:
        qd: (n,), rad/s.
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        momentum_rate: torque that drives the arm, whatever it comes from, (n,), N m.
        step_max: N m per tick.
        dt: tick, s.
        speed: (n,), rad/s; filled.
        ahead: (n,), s; filled.
    """
    n = qd.shape[0]
    impulse = stack_vector(n)
    for i in range(n):
        ahead[i] = abs(momentum_rate[i]) * (dt / step_max)
        impulse[i] = 0.5 * momentum_rate[i] * ahead[i]
    matvec_into(M_inv, impulse, speed)
    for i in range(n):
        speed[i] += qd[i]


@compiled
def joint_excess(q, qd, speed, ahead, q_min, q_max, qd_max, margin, deceleration, excess, intrusion):
    """Fill by how much each joint is too fast and too far, signed by its direction; tell whether any is.

    A joint may move no faster than it can be stopped before a margin of its range, √(2 a d), nor than its speed limit;
    what counts is the speed that it will have before the torque that drives it can be taken off.

    Args:
        q, qd: (n,), rad and rad/s.
        speed: by then, (n,), rad/s; see `predict_velocity`.
        ahead: time until then, (n,), s.
        q_min, q_max: range, (n,), rad.
        qd_max: speed limits, (n,), rad/s.
        margin: rad.
        deceleration: a, rad/s².
        excess: (n,), rad/s; filled: positive where it moves up.
        intrusion: into the margin, (n,), rad; filled: positive at the upper end.
    """
    some = False
    for i in range(q.shape[0]):
        way = 1.0 if speed[i] > 0.0 else -1.0
        left = (q_max[i] - q[i] if way > 0.0 else q[i] - q_min[i]) - margin - max(way * qd[i], 0.0) * ahead[i]
        allowed = min(qd_max[i], math.sqrt(2.0 * deceleration * max(left, 0.0)))
        excess[i] = way * max(way * speed[i] - allowed, 0.0)
        intrusion[i] = max(q[i] - q_max[i] + margin, 0.0)
        if intrusion[i] == 0.0:
            intrusion[i] = min(q[i] - q_min[i] - margin, 0.0)
        some = some or excess[i] != 0.0 or intrusion[i] != 0.0
    return some


@compiled
def joint_stop_gains(M, damping, rate, excess, intrusion, gain, stiffness, delay_s, brake, spring, drag):
    """Fill what the joint stops may brake and push back with, kept within what those joints take (`control.damping`).

    Args:
        M: joint inertia, (n, n), kg m².
        damping: that acts on each joint already, (n,), N m s/rad.
        rate: largest eigenvalue allowed of all of it, 1/s.
        excess, intrusion: of `joint_excess`, (n,); joints without either get nothing.
        gain: braking per excess of speed, 1/s.
        stiffness: N m/rad of intrusion.
        delay_s: of the loop, s.
        brake: (n,), N m s/rad; filled: in proportion to the inertia that the joint moves.
        spring: (n,), N m/rad; filled: no more than lets damping make up twice for its delay.
        drag: (n,), N m s/rad; filled: that damping, where the brake does not act.
    """
    n = brake.shape[0]
    left, left_inv, most = stack_matrix(n, n), stack_matrix(n, n), stack_vector(n)
    for i in range(n):
        for j in range(n):
            left[i, j] = rate * M[i, j]
        left[i, i] -= damping[i]
    if not spd_inverse(left, left_inv):
        left_inv[:] = 0.0
    for i in range(n):
        if excess[i] == 0.0 and intrusion[i] == 0.0:
            left_inv[i, :], left_inv[:, i] = 0.0, 0.0
            left_inv[i, i] = 1.0
    joint_damping_limits(left_inv, 1.0, most)
    for i in range(n):
        stopped = excess[i] != 0.0 or intrusion[i] != 0.0
        brake[i] = min(gain * M[i, i], most[i]) if stopped else 0.0
        spring[i] = min(stiffness, (damping[i] + brake[i]) / (2.0 * delay_s)) if stopped else 0.0
        drag[i] = min(2.0 * delay_s * spring[i], brake[i])


@compiled
def joint_stop_torque(tau_net, M_inv, qd, excess, intrusion, margin, brake, spring, drag):
    """Keep joints in their range and below their speed limits, in place; away from both nothing changes.

    What is too fast is braked, and what pushes it on fades; within the margin a spring pushes back, damped on the way
    out as well. What pushes a joint on is its own torque, or the acceleration that the whole command gives it, as a
    torque of its own, (M⁻¹ τ)_i/(M⁻¹)_ii, whichever is more. Its own counts up to `_RELEASE_RAD_S2` of the inertia that
    the joint moves alone: on a chain of parallel axes it may be just what holds the joint against all the others.

    Args:
        tau_net: command less gravity and Coriolis torque, (n,), N m; updated.
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        qd: (n,), rad/s.
        excess, intrusion: of `joint_excess`, (n,), rad/s and rad.
        margin: rad.
        brake: per excess of speed, (n,), N m s/rad.
        spring: per intrusion, (n,), N m/rad.
        drag: on the way out of the margin, (n,), N m s/rad.
    """
    for i in range(qd.shape[0]):
        if excess[i] == 0.0 and intrusion[i] == 0.0:
            continue
        inertia = 1.0 / M_inv[i, i]
        push, change = inertia * dot(M_inv[i], tau_net), 0.0
        if excess[i] != 0.0:
            way = 1.0 if excess[i] > 0.0 else -1.0
            on = max(min(way * tau_net[i], _RELEASE_RAD_S2 * inertia), way * push, 0.0)
            change = -way * on * min(way * excess[i] / _FADE_RAD_S, 1.0) - brake[i] * excess[i]
        if intrusion[i] != 0.0:
            out = 1.0 if intrusion[i] > 0.0 else -1.0
            on = max(min(out * (tau_net[i] + change), _RELEASE_RAD_S2 * inertia), out * (push + change), 0.0)
            change -= out * on * min(out * intrusion[i] / margin, 1.0)
            change -= spring[i] * intrusion[i] + out * drag[i] * min(out * qd[i], 0.0)
        tau_net[i] += change


@compiled
def limit_torque(tau, tau_previous, tau_max, step_max, M_inv):
    """Keep a command within the torque limits and a largest change per tick, in place, and as near to what was asked.

    A joint whose torque is clipped accelerates otherwise than it was asked to, and drags along all that is coupled to
    it: 30 N m too little on a shoulder fling a wrist of 1e-5 kg m² aside. By Gauss's principle of least constraint the
    command sought has the least (τ − τ_w)ᵀ M⁻¹ (τ − τ_w): every joint that is not at a bound then accelerates just as
    asked.

    Args:
        tau: command τ_w, (n,), N m; updated.
        tau_previous: last command sent, (n,), N m.
        tau_max: (n,), N m.
        step_max: N m per tick.
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).

    Returns:
        True where anything was clipped.
    """
    clipped = False
    for i in range(tau.shape[0]):
        low, high = _bounds(tau_previous[i], tau_max[i], step_max)
        clipped = clipped or tau[i] < low or tau[i] > high
    if clipped:
        _constrain_least(tau, tau_previous, tau_max, step_max, M_inv)
    return clipped


@compiled
def _bounds(tau_previous, tau_max, step_max):
    """Give what a torque may be: within the limit, even where the last one was beyond it."""
    low = min(max(tau_previous - step_max, -tau_max), tau_max)
    return low, max(min(tau_previous + step_max, tau_max), -tau_max)


@compiled
def _constrain_least(tau, tau_previous, tau_max, step_max, M_inv):
    """Clip a command in place, and let each joint in turn make up for it; no such step makes it worse."""
    n = tau.shape[0]
    low, high, change = stack_vector(n), stack_vector(n), stack_vector(n)
    for i in range(n):
        low[i], high[i] = _bounds(tau_previous[i], tau_max[i], step_max)
        value = min(max(tau[i], low[i]), high[i])
        change[i], tau[i] = value - tau[i], value
    for sweep in range(_SWEEPS):
        moved = False
        for k in range(n):
            i = k if sweep % 2 == 0 else n - 1 - k
            astray = dot(M_inv[i], change)  # acceleration beyond what was asked, rad/s²
            much = max(astray - _ASTRAY_RAD_S2, 0.0) + min(astray + _ASTRAY_RAD_S2, 0.0)
            value = min(max(tau[i] - much / M_inv[i, i], low[i]), high[i])
            moved = moved or value != tau[i]
            change[i] += value - tau[i]
            tau[i] = value
        if not moved:
            break
