"""The program as `python -m contactsafe`."""

import sys

from contactsafe.cli import main

sys.exit(main())
