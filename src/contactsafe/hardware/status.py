"""What the processes of a run show each other: heartbeats, states, wishes and figures; every number has one writer."""

import numpy as np

BUSY_BINS = 2000
"""Of the histogram of the loop's busy time, 1 µs each, the last one for all above."""

_i = np.int64
_f = np.float64

status_dtype = np.dtype(
    [
        ("joints", _i),
        ("lockstep", _i),  # the control process waits for the policy's targets, tick by tick
        ("beat_control", _i),  # counts up while a process lives
        ("beat_policy", _i),
        ("beat_watchdog", _i),
        ("beat_recorder", _i),
        ("beat_command", _i),
        ("pid_control", _i),
        ("pid_policy", _i),
        ("pid_watchdog", _i),
        ("pid_recorder", _i),
        ("pid_command", _i),
        ("ready_policy", _i),  # it waits for the first state
        ("go", _i),  # the control process may begin
        ("last_tick", _i),  # at which time is up, 0 for never
        ("stop", _i),  # reason for which the run is to end, 0 for none; first one stays
        ("state", _i),  # of the control process
        ("reason", _i),
        ("tick", _i),
        ("steps", _i),  # of the policy
        ("target_age", _i),  # ticks
        ("refused", _i),  # targets
        ("lost", _i),  # states of the robot that did not come
        ("waits_for_robot", _i),  # the control process waits for the robot's next state
        ("finished", _i),  # the control process has let go of the robot
        ("recorded", _i),  # ticks written
        ("dropped", _i),  # ticks that the recorder was too slow for
        ("recorder_errno", _i),  # why it writes no more, 0 while it does
        ("first_step_nm", _f),  # largest change of a torque in the first command
        ("largest_step_nm", _f),  # and in any later one
        ("tool_speed", _f),  # m/s
        ("contact_link", _i),  # 0 for none
        ("contact_nm", _f),  # size of its torque
        ("contact_n", _f),  # and of its force, as far as torques tell it
        ("tool_n", _f),  # force on the tool
        ("busy", _i, (BUSY_BINS,)),  # histogram
        ("rows", _i),  # ticks put into the ring
        ("steps_written", _i),  # steps put into theirs
    ]
)
