"""`python -m evplace` is the command line."""

from __future__ import annotations

import sys

from evplace.cli import main

sys.exit(main())
