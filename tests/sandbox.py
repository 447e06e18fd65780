"""A process that cannot leave its machine: the kernel ends it with SIGSYS at the first socket, of native code as well.

Sockets within the machine are let pass: C libraries look up the name of a user by one.
"""

import ctypes
import platform
import signal
import socket
import struct
import subprocess
import sys

SOCKET = {"x86_64": (0xC000003E, 41), "aarch64": (0xC00000B7, 198)}
"""Kernel's name of the machine and number of the system call, by machine."""

_NO_NEW_PRIVILEGES, _SECCOMP, _FILTER = 38, 22, 2
_LOAD, _EQUAL, _RETURN = 0x20, 0x15, 0x06
_ALLOW, _KILL = 0x7FFF0000, 0x80000000


def forbid_sockets():
    """End this process, and those it starts, at the first socket(2) but for AF_UNIX; see seccomp(2).

    Raises:
        OSError: this kernel, or this machine, cannot do that.
    """
    if sys.platform != "linux" or platform.machine() not in SOCKET:
        raise OSError("no filter for this machine")
    machine, number = SOCKET[platform.machine()]
    is_socket = ((_LOAD, 0, 0, 4), (_EQUAL, 0, 5, machine), (_LOAD, 0, 0, 0), (_EQUAL, 0, 3, number))
    leaves = ((_LOAD, 0, 0, 16), (_EQUAL, 1, 0, socket.AF_UNIX))  # the first argument
    steps = (*is_socket, *leaves, (_RETURN, 0, 0, _KILL), (_RETURN, 0, 0, _ALLOW))
    program = b"".join(struct.pack("HBBI", *step) for step in steps)
    code = ctypes.create_string_buffer(program, len(program))
    head = ctypes.create_string_buffer(struct.pack("HxxxxxxP", len(steps), ctypes.addressof(code)))
    libc = ctypes.CDLL(None, use_errno=True)
    for call in ((_NO_NEW_PRIVILEGES, 1, 0, 0, 0), (_SECCOMP, _FILTER, head, 0, 0)):
        if libc.prctl(*call):
            raise OSError(ctypes.get_errno(), "prctl")


def run_without_sockets(code, environment, folder, timeout=300):
    """Run Python code in such a process; return what `subprocess.run` gives."""
    return subprocess.run(
        [sys.executable, "-c", f"from tests.sandbox import forbid_sockets; forbid_sockets()\n{code}"],
        env=environment, cwd=folder, capture_output=True, text=True, timeout=timeout, check=False,
    )  # fmt: skip


def opened_a_socket(ended):
    """Tell whether that is why the process ended."""
    return ended.returncode == -signal.SIGSYS
