"""Numbers that stand for words in the records: modes, kinds of contact, faults, what limited a command."""

FREE, COMPLY, REJECT = 0, 1, 2
"""Modes: no contact on the arm; it complies with an obstacle; it rejects a push."""

NO_CONTACT, OBSTACLE, PUSH, TOOL = 0, 1, 2, 3
KINDS = {NO_CONTACT: "none", OBSTACLE: "obstacle", PUSH: "push", TOOL: "tool"}
"""What a contact is classified as. One on the arm counts as an obstacle until it has shown that it pushes."""

BAD_MEASUREMENT, BAD_TARGET, BAD_QUATERNION, BAD_GAIN, MISSING, NO_TORQUE = 1, 2, 3, 4, 5, 6
REPEATED, OVERDUE, UNTRUE, LOAD, RUNAWAY, CLOCK, BAD_BASE = 7, 8, 9, 10, 11, 12, 13
FAULTS = {
    0: "none",
    BAD_MEASUREMENT: "a measurement is not finite or beyond what the arm can do; it was bridged by a prediction",
    BAD_TARGET: "target is not finite or absurdly large; the last good target holds",
    BAD_QUATERNION: "target quaternion is not of unit length; the last good target holds",
    BAD_GAIN: "target stiffness or damping is out of range; the last good target holds",
    MISSING: "measurements stayed unusable for over 20 ticks; the arm was braked until reset",
    NO_TORQUE: "the law gave no finite torque; the last torque was repeated",
    REPEATED: "the same measurement of motion, or with its time, for over 20 ticks; the arm was braked until reset",
    OVERDUE: "over 20 ticks passed between two measurements; the arm was braked until reset",
    UNTRUE: "measurements contradict each other, or go on elsewhere, for over 20 ticks; the arm was braked until reset",
    LOAD: "a load, or a push like one, that the controller was not told of keeps the tool off; see payload_estimate()",
    RUNAWAY: "a joint stays beyond its speed limit though it is braked: the arm runs away; it is damped, nothing else",
    CLOCK: "the time of a measurement stood or went back while the joints went on; they tell the time instead",
    BAD_BASE: "the wrench at the base is not finite or absurdly large; contacts are placed without it, nothing else",
}
"""What `fault` in the state and output means. The first is latched until reset, but what brakes the arm replaces it:
MISSING, REPEATED, OVERDUE, UNTRUE and RUNAWAY; and so does LOAD where nothing brakes, which goes once it is told."""

LIMITED_BY_CONTACT, LIMITED_BY_TOOL_FORCE, LIMITED_BY_ENERGY, LIMITED_BY_RATE, LIMITED_BY_RANGE = 1, 2, 4, 8, 16
LIMITED_BY_LOAD = 32
LIMITS = {
    LIMITED_BY_CONTACT: "contact",
    LIMITED_BY_TOOL_FORCE: "tool force",
    LIMITED_BY_ENERGY: "energy",
    LIMITED_BY_RATE: "rate",
    LIMITED_BY_RANGE: "range",
    LIMITED_BY_LOAD: "load",
}
"""What takes something off a command: the bound on the force along a contact, the one on the force of the tool, the
energy tank, torque and its rate, joint range and speed; and whether it was a load that did."""
