"""Put the robots and worlds, which lie beside the package in a checkout, into the wheel."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
INSIDE = "toolkit/_shipped"  # where toolkit/shipped.py looks


class BuildWithShipped(build_py):
    """Copies the package, then `robots/` and `worlds/` into it. An editable install finds them in the checkout."""

    def run(self):
        """Build."""
        super().run()
        if not self.editable_mode:
            for kind in ("robots", "worlds"):
                target = Path(self.build_lib, INSIDE, kind)
                shutil.rmtree(target, ignore_errors=True)
                shutil.copytree(ROOT / kind, target, ignore=shutil.ignore_patterns("__pycache__", ".*"))


setup(cmdclass={"build_py": BuildWithShipped})
