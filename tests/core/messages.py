"""What is said on stderr where compiled code cannot be kept."""


def say_once(capsys):
    told = capsys.readouterr().err
    assert told.startswith("contactsafe: compiled code cannot be kept (")
    assert told.endswith("; set NUMBA_CACHE_DIR to a folder that you alone may write to\n")
    assert told.count("\n") == 1
    return told.partition("(")[2].partition(")")[0]
