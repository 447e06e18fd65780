"""What commands say to a user who made a mistake."""

from contactsafe.cli import main


def mistake(capsys, *words):
    """Run a command that must fail by its user's fault; return the one line it says."""
    assert main(list(words)) == 1
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.strip().splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("contactsafe: ")
    return lines[0].removeprefix("contactsafe: ")
