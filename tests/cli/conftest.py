"""`check` in a shell of its own, on ports of one test's own."""

import json
import subprocess
import sys

import pytest
from sites import Site


class CheckedSite(Site):
    def check(self, *words, timeout_s=60):
        """(exit status, text for people, JSON of the last line)."""
        command = [sys.executable, "-m", "fwav_companion", "check", "--config", "fwav-companion.toml", "--json", *words]
        done = subprocess.run(command, capture_output=True, text=True, cwd=self.folder, timeout=timeout_s)
        *said, last = done.stdout.splitlines()
        assert done.stderr == ""
        return done.returncode, "\n".join(said), json.loads(last)


@pytest.fixture
def site(tmp_path):
    site = CheckedSite(tmp_path)
    yield site
    site.close()
