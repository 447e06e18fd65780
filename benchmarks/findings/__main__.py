"""Run the findings named by number, or all."""

import sys
from collections.abc import Callable, Sequence

from benchmarks.findings.bounds import force_and_energy, gains_that_pump, soft_wrist
from benchmarks.findings.classification import push_or_obstacle, stiff_obstacle_that_stays
from benchmarks.findings.detection import masses_of_the_links, naming_the_link, slow_observer, tool_and_arm_told_apart
from benchmarks.findings.equations import (
    gravity_in_the_null_space,
    printed_projector_is_0_over_0,
    projector_is_zero,
    sign_of_the_external_torque,
)
from benchmarks.findings.landing import tool_that_lands_under_a_push
from benchmarks.findings.peaks import (
    bounded_push,
    force_added_drags_the_arm,
    impact_on_a_fixed_obstacle,
    printed_law_can_hurt,
    yield_or_hold,
)

FINDINGS: dict[int, Callable[[], None]] = {
    1: projector_is_zero,
    2: slow_observer,
    3: printed_law_can_hurt,
    4: bounded_push,
    5: yield_or_hold,
    6: printed_projector_is_0_over_0,
    7: tool_and_arm_told_apart,
    8: soft_wrist,
    10: sign_of_the_external_torque,
    11: gravity_in_the_null_space,
    12: force_added_drags_the_arm,
    13: push_or_obstacle,
    14: stiff_obstacle_that_stays,
    15: naming_the_link,
    16: masses_of_the_links,
    17: impact_on_a_fixed_obstacle,
    18: force_and_energy,
    19: gains_that_pump,
    22: tool_that_lands_under_a_push,
}


def main(arguments: Sequence[str] = ()) -> int:
    """Run the findings named by number, or all."""
    try:
        wanted = [int(word) for word in arguments] or list(FINDINGS)
        chosen = {number: FINDINGS[number] for number in wanted}
    except (ValueError, KeyError):
        print(f"findings: give numbers out of {', '.join(map(str, FINDINGS))}, or none for all", file=sys.stderr)
        return 2
    for number, measure in chosen.items():
        if len(chosen) > 1:
            print(f"{number}. {(measure.__doc__ or '').strip()}", flush=True)
        measure()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
