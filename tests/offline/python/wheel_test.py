"""The wheel of the module, as pip installs it."""

import base64
import hashlib
import os
import pathlib
import subprocess
import sys
import tempfile
import zipfile

import support
import tumbler

PACKAGE = pathlib.Path(tumbler.__file__).parent
BUILD = PACKAGE.parent.parent
PYTHON = "/usr/bin/python3"

CALL = """
import sys, tumbler
assert tumbler.__file__.startswith(sys.prefix), tumbler.__file__
print(tumbler.__version__, tumbler.check(sys.argv[1]))
"""


class Wheel(support.WithFolder):
    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.shared.cleanup)

    def any_wheel(self):
        """A wheel that was made once for all tests."""
        return next(pathlib.Path(self.shared.name).glob("*.whl"), None) or self.wheel(self.shared.name)

    def wheel(self, folder="wheels", *options):
        command = [support.ROOT / "scripts/wheel", self.folder / folder, "--build", BUILD, *options]
        done = subprocess.run(command, capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return pathlib.Path(done.stdout.strip())

    def test_is_installed_in_an_environment_and_works_there(self):
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        run = lambda *command: subprocess.run(
            list(map(str, command)), capture_output=True, text=True, env=environment, cwd=self.folder
        )
        venv = self.folder / "venv"
        done = run(PYTHON, "-m", "venv", "--system-site-packages", "--without-pip", venv)
        self.assertEqual(done.returncode, 0, done.stderr)
        pip = (PYTHON, "-m", "pip", "--disable-pip-version-check", "--python", venv / "bin/python")
        done = run(*pip, "install", "--no-index", "--no-deps", self.any_wheel())
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run(venv / "bin/python", "-c", CALL, support.PRIMITIVES / "handstand.toml")
        self.assertEqual((done.stdout, done.stderr), (f"{tumbler.__version__} primitive\n", ""))
        done = run(*pip, "uninstall", "--yes", "tumbler")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(list(venv.rglob("*tumbler*")), [])

    def test_has_every_file_of_the_package_with_its_hash(self):
        with zipfile.ZipFile(self.any_wheel()) as archive:
            names = archive.namelist()
            record = archive.read(names[-1]).decode().splitlines()
            for line in record[:-1]:
                name, digest, length = line.split(",")
                data = archive.read(name)
                expected = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
                self.assertEqual((digest, int(length)), (f"sha256={expected}", len(data)), name)
        self.assertEqual([line.split(",")[0] for line in record], names)
        package = {f"tumbler/{path.name}" for path in PACKAGE.iterdir() if path.is_file()}
        self.assertEqual({name for name in names if name.startswith("tumbler/")}, package)

    def test_of_the_same_build_is_the_same_byte_for_byte(self):
        self.assertEqual(self.wheel("again").read_bytes(), self.any_wheel().read_bytes())

    def test_says_what_it_needs_of_debian(self):
        with zipfile.ZipFile(self.wheel("wheels", "--needs", "libfmt9 (>= 9.1), libc6")) as archive:
            name = next(name for name in archive.namelist() if name.endswith("METADATA"))
            lines = archive.read(name).decode().splitlines()
        self.assertIn("Requires-External: libfmt9 (>= 9.1)", lines)
        self.assertIn("Requires-External: libc6", lines)
        self.assertIn(f"Version: {tumbler.__version__}", lines)


if __name__ == "__main__":
    support.main(sys.argv)
