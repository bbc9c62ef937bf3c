"""How much memory some code takes, in a process of its own: the peak of a worker is that of all its earlier tests."""

from __future__ import annotations

import subprocess
import sys

AROUND = """
import resource
{imports}
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
{code}
print("kB:", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def peak_growth_kb(imports: str, code: str) -> int:
    """Growth of the peak of resident memory by the code, after the imports, kB; it must end without an exception."""
    program = AROUND.format(imports=imports, code=code)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return int(done.stdout.rpartition("kB:")[2])
