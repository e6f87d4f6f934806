"""The examples make what their page says."""

import re
import subprocess
import sys

import matplotlib.image
import support

EXAMPLE = support.ROOT / "docs/examples/handstand.py"
STUDY = support.ROOT / "docs/examples/study.py"


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


class Study(support.WithFolder):
    def test_of_five_tasks_in_a_process_pool_says_what_came_of_each(self):
        done = subprocess.run([sys.executable, "-B", STUDY, "20"], capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        lines = done.stdout.splitlines()
        self.assertEqual([line.split(":")[0] for line in lines], ["0.6 s", "0.65 s", "0.7 s", "0.75 s", "0.8 s"])
        found = [line for line in lines if re.search(r": cost [0-9.e-]+, [0-9]+% of 20 robots stand$", line)]
        self.assertEqual(found, lines)
        self.assertEqual(len({line.split("cost")[1].split(",")[0] for line in found}), 5)  # Each its own motion.


if __name__ == "__main__":
    support.main(sys.argv)
