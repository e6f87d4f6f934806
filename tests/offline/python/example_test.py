"""The example makes its figures."""

import subprocess
import sys

import matplotlib.image
import support

EXAMPLE = support.ROOT / "docs/examples/handstand.py"


def size_of(png):
    """Width and height of a PNG file [pixels]."""
    data = png.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n" and data.endswith(b"IEND\xaeB`\x82")
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


class Example(support.WithFolder):
    def test_makes_figures_of_a_motion_a_run_and_robots(self):
        command = [sys.executable, "-B", EXAMPLE, self.folder / "figures", "--robots", "6"]
        done = subprocess.run(command, capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("run completed", done.stdout)
        self.assertRegex(done.stdout, r"\d of 6 robots stand")
        for name in ("motion", "run", "robots"):
            image = matplotlib.image.imread(self.folder / f"figures/{name}.png")
            self.assertGreater(min(size_of(self.folder / f"figures/{name}.png")), 500)
            self.assertGreater(image[..., :3].std(), 0.05)  # It is not of one colour.


if __name__ == "__main__":
    support.main(sys.argv)
