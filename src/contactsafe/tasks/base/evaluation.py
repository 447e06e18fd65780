"""How well a policy wipes: held-out boards, one episode each, no exploration. No torch."""

import numpy as np

from contactsafe.core.errors import InvalidInputError

CONTACT_N = 0.5
"""Tool force above which the pad counts as pressed, N: what it takes to erase."""


FIGURES = {
    "episodes": "boards wiped, one episode each",
    "success": "fraction of boards wiped clean (99.8 % of the ink gone, unless told otherwise), which ends the episode",
    "cleared_99": "fraction of boards with 99 % of their ink gone within the time limit",
    "ink_removed_mean": "fraction of a board's ink that was wiped off: mean",
    "ink_removed_median": "the same: median",
    "ink_removed_p10": "the same: 10th percentile",
    "time_mean_s": "length of an episode, s: mean; 20 s where nothing ended it before, such as a clean board",
    "time_to_clean_median_s": "the same, of the boards wiped clean alone: median",
    "peak_force_median_n": "largest force on the tool in an episode, N: median",
    "peak_force_p95_n": "the same: 95th percentile",
    "peak_force_max_n": "the same: largest of all",
    "contact_force_median_n": "force on the tool, N, the largest of each policy step in contact: median",
    "arm_table_contacts": "episodes ended because something other than the pad met board or table",
    "contact_fraction": "fraction of all policy steps in which the tool was in contact; the rest goes from patch to patch",
    "return_mean": "sum of an episode's rewards: mean",
}
"""What `evaluate_policy` returns, in its order, and what it means; forces are the simulator's."""

HELD_OUT_SEED = 1_000_003
"""Added to the seeds of boards that are never trained on."""


def step_values(info, done, key):
    """Read one number per environment from a vector environment's info, the last of an episode where it ended.

    With AutoresetMode.SAME_STEP the top level of info already belongs to the next episode where one ended; what the
    ended one reported is under "final_info".

    Args:
        info: of `VectorEnv.step`.
        done: which environments ended an episode, (N,) bool.
        key: name of the number.

    Returns:
        Values, (N,) float64; 0 where the environment reported none.
    """
    values = np.zeros(len(done))
    if key in info:
        values[:] = np.asarray(info[key], dtype=np.float64)
    if done.any() and key in info.get("final_info", {}):
        values[done] = np.asarray(info["final_info"][key], dtype=np.float64)[done]
    return values


def evaluate_policy(policy, vec_env, episodes, seed, rate_hz=60.0, on_episode=None):
    """Run a policy over seeded episodes.

    Each environment runs the same number of episodes, so short ones are not counted more often than long ones.

    Args:
        policy: has `act(observation)` for a batch and `action_repeat`; where it keeps something in mind, `begin(i)`
            is called as an episode of environment i begins.
        vec_env: a gymnasium VectorEnv with AutoresetMode.SAME_STEP; its info has ink_left, tool_force_n, is_success.
        episodes: to run in all; rounded up to a multiple of vec_env.num_envs.
        seed: of the first reset; use one that training did not.
        rate_hz: environment steps a second, for the times.
        on_episode: called with the record of each episode as it ends, for a progress bar.

    Returns:
        A dict of `FIGURES`, NaN where nothing was wiped clean, and records: a dict per episode, by environment and then
        by time.

    Raises:
        InvalidInputError: episodes is below 1.
    """
    if episodes < 1:
        raise InvalidInputError(f"episodes = {episodes}; give 1 or more")
    n = vec_env.num_envs
    quota = -(-episodes // n)
    observation, _ = vec_env.reset(seed=seed)
    held = np.zeros((n, *vec_env.single_action_space.shape), np.float32)
    steps, peak, returns = np.zeros(n, int), np.zeros(n), np.zeros(n)
    records: list[list[dict]] = [[] for _ in range(n)]
    contact_forces, all_steps = [], 0
    begin = getattr(policy, "begin", lambda i: None)
    for k in range(n):
        begin(k)
    while any(len(r) < quota for r in records):
        fresh = steps % policy.action_repeat == 0
        if fresh.any():
            held = np.where(fresh[:, None], policy.act(observation), held)
        observation, reward, terminated, truncated, info = vec_env.step(held)
        done = np.asarray(terminated) | np.asarray(truncated)
        force = step_values(info, done, "tool_force_n")
        ink_left, success = step_values(info, done, "ink_left"), step_values(info, done, "is_success")
        touched = step_values(info, done, "arm_touched")
        active = np.array([len(r) < quota for r in records])
        all_steps += int(active.sum())
        contact_forces.append(force[active & (force > CONTACT_N)])
        steps, peak, returns = steps + 1, np.maximum(peak, force), returns + reward
        for i in np.flatnonzero(done & active):
            records[i].append(
                {
                    "success": bool(success[i]),
                    "ink_removed": float(1.0 - ink_left[i]),
                    "time_s": float(steps[i] / rate_hz),
                    "peak_force_n": float(peak[i]),
                    "arm_touched": bool(touched[i]),
                    "return": float(returns[i]),
                }
            )
            if on_episode is not None:
                on_episode(records[i][-1])
        steps[done], peak[done], returns[done] = 0, 0.0, 0.0
        for k in np.flatnonzero(done).tolist():
            begin(k)
    return _summary([record for env_records in records for record in env_records], contact_forces, all_steps)


def _summary(records, contact_forces, all_steps):
    forces = np.concatenate(contact_forces)
    success = np.array([r["success"] for r in records])
    removed, times, peaks, returns = (
        np.array([r[key] for r in records]) for key in ("ink_removed", "time_s", "peak_force_n", "return")
    )
    return {
        "episodes": len(records),
        "success": float(success.mean()),
        "cleared_99": float((removed >= 0.99).mean()),
        "ink_removed_mean": float(removed.mean()),
        "ink_removed_median": float(np.median(removed)),
        "ink_removed_p10": float(np.quantile(removed, 0.1)),
        "time_mean_s": float(times.mean()),
        "time_to_clean_median_s": float(np.median(times[success])) if success.any() else float("nan"),
        "peak_force_median_n": float(np.median(peaks)),
        "peak_force_p95_n": float(np.quantile(peaks, 0.95)),
        "peak_force_max_n": float(peaks.max()),
        "contact_force_median_n": float(np.median(forces)) if len(forces) else 0.0,
        "arm_table_contacts": int(sum(r["arm_touched"] for r in records)),
        "contact_fraction": float(len(forces) / all_steps),
        "return_mean": float(returns.mean()),
        "records": records,
    }
