"""Nothing leaves this machine: what dependencies would tell about it is switched off before they are imported.

ONNX Runtime from 1.31 looks up its maker's host and keeps a device id in `~/.cache/Microsoft`, from its import on; a
switch set later comes too late. Of the other dependencies none tells anything (`tests/test_nothing_leaves.py`). The
switches stand in the environment, so that worker processes have them as well.
"""

import os

SWITCHES = {"ORT_DISABLE_TELEMETRY": "1"}
"""Environment variables, whatever they were before."""

os.environ.update(SWITCHES)
