"""Lets these tests import their helpers by their own names."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
