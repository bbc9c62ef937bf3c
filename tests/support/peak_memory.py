"""How much memory some code takes, in a process of its own: the peak of a worker is that of all its earlier tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

AROUND = """
import sys
sys.path.append({support!r})
from peak_memory import peak_kb
{imports}
before = peak_kb()
{code}
print("kB:", peak_kb() - before)
"""


def peak_kb() -> int:
    """Peak of this process's resident memory, kB.

    ``VmHWM`` is its own; ``ru_maxrss`` of getrusage begins with that of the process that started it.
    """
    (line,) = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM:")]
    return int(line.split()[1])


def peak_growth_kb(imports: str, code: str) -> int:
    """Growth of the peak of resident memory by the code, after the imports, kB; it must end without an exception."""
    program = AROUND.format(support=str(Path(__file__).parent), imports=imports, code=code)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return int(done.stdout.rpartition("kB:")[2])
