"""What experiments measure, as data: trials, metrics with their aims, recorded curves, and the stage they played on.

Experiments and tasks declare, reports render; neither of the two sides knows the other.
"""
