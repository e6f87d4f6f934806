"""What the tests of the Python module share: where the project and its programs are."""

import pathlib
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[3]
PRIMITIVES = ROOT / "primitives"


class WithFolder(unittest.TestCase):
    """Tests with a folder of their own."""

    programs = pathlib.Path()  # The folder of the programs.

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_program(self, name, *arguments):
        """Runs a command such as `tumbler run`, which has to succeed. Returns what it printed."""
        done = subprocess.run([self.programs / name.split()[0], *name.split()[1:], *map(str, arguments)], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout


def main(argv):
    """usage: TEST.py PROGRAMS    the folder of the programs; the module is found by PYTHONPATH"""
    WithFolder.programs = pathlib.Path(argv.pop(1))
    unittest.main(module="__main__", argv=argv)
