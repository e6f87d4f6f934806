"""The guide of docs/identify.md with a robot on a CAN interface, which nobody knows: each of its commands runs as it
stands there, but that `tumbler run sim ... --twin FILE` becomes `tumbler run INTERFACE ... --arm`, and another process,
`tumbler twin`, is the robot of that file, its drives and its floor.

usage: identify_on_can_test.py BIN    the folder of the command tumbler; needs CAN in the kernel (scripts/guest)

Both programs count twenty seconds of the clock as one of the robot, and the loop is slower than on a robot, because a
guest may stand still for some 40 ms. No time is asserted.
"""

import os
import pathlib
import re
import shlex
import signal
import subprocess
import tempfile
import unittest

from docs_commands_test import BIN, ROOT, commands

PACE, RATE_HZ, WATCHDOG_S = 0.05, 500.0, 0.2
TRIES = 4
DRIVES = "primitives/robots/tumbler_drives.toml"


class Interface:
    """A virtual CAN interface that is up until the end of its scope."""

    def __enter__(self):
        self.name = f"vi{os.getpid()}"
        for command in (
            f"ip link add {self.name} type vcan",
            f"ip link set {self.name} txqueuelen 10",
            f"ip link set {self.name} up",
        ):
            subprocess.run(command.split(), check=True)
        return self.name

    def __exit__(self, *_):
        subprocess.run(["ip", "link", "del", self.name], check=True)


class Guide(unittest.TestCase):
    maxDiff = None

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        for name in ("primitives", "tests"):
            (self.folder / name).symlink_to(ROOT / name)
        (self.folder / "build/release").mkdir(parents=True)
        (self.folder / "build/release/bin").symlink_to(BIN)
        text = (ROOT / DRIVES).read_text()
        text = re.sub(r"rate_hz = [\d.]+", f"rate_hz = {RATE_HZ}", text)
        text = re.sub(r"watchdog_s = [\d.]+", f"watchdog_s = {WATCHDOG_S}", text)
        (self.folder / "drives.toml").write_text(text)

    def run_here(self, words):
        """A command with the drives of this test. Returns its status and what it said."""
        words = ["drives.toml" if word == DRIVES else word for word in words]
        done = subprocess.run(words, cwd=self.folder, capture_output=True, text=True)
        print("$", *words, "\n" + done.stdout + done.stderr, flush=True)
        return done.returncode, done.stdout + done.stderr

    def play(self, words, interface):
        """A run of the guide, of a robot on the interface. Returns the statuses of the run and of the robot."""
        program, twin_file = words[0], words[words.index("--twin") + 1]
        motion = words[3]
        both = ["--drives", "drives.toml", "--pace", str(PACE)]
        with subprocess.Popen(
            [program, "twin", interface, motion, "--twin", twin_file, *both],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as twin:
            said = twin.stdout.readline()
            while said and "2 drives on" not in said:
                said = twin.stdout.readline()
            at = words.index("--twin")
            rest = words[4:at] + words[at + 2 :]
            armed = ["--arm", "--realtime", "--hold-s", "0.6", "--end", "torque-off"]
            status, text = self.run_here([program, "run", interface, motion, *both, *armed, *rest])
            twin.send_signal(signal.SIGINT)
            print(said + twin.stdout.read(), flush=True)
        return status, twin.returncode, text

    def record(self, words, interface):
        """Plays a run of the guide, and expects of it what the guide does."""
        record = self.folder / words[words.index("--record") + 1]
        record.unlink(missing_ok=True)  # A record is never overwritten.
        status, robot, text = self.play(words, interface)
        self.assertTrue(record.exists(), text)
        if record.name == "first.rec":
            self.assertEqual(robot, 4, "the shipped handstand fails on the robot that nobody knows")
        else:
            self.assertEqual((status, robot), (0, 0), text)

    def fit(self, words, runs, interface):
        """A fit of the guide. Where one process or the other stood still for too long, time passed in a record as it
        does on no robot, and no robot explains it: its runs are played once more then. What replies are late by on their
        way back differs from run to run here, by more than a fit that goes on from others takes for possible: such a fit
        need not explain its record, but has to say so."""
        for _ in range(TRIES):
            status, text = self.run_here(words)
            if status == 0:
                return
            self.assertEqual(status, 4, text)
            self.assertIn("an EFFECTIVE model", text)
            if "--prior" in words:
                return
            for record in (word for word in words if word.endswith(".rec")):
                self.record(runs[record], interface)
        self.fail(f"no record of {TRIES} was explained:\n{text}")

    def test_each_command_runs_with_a_robot_on_a_can_interface(self):
        ran, runs = [], {}
        with Interface() as interface:
            for command in commands("docs/identify.md"):
                words = shlex.split(command)
                if words[1] == "run":
                    runs[words[words.index("--record") + 1]] = words
                    self.record(words, interface)
                elif words[1:3] == ["identify", "fit"]:
                    self.fit(words, runs, interface)
                else:
                    status, text = self.run_here(words)
                    closed = "gate primitives/handstand.toml" in command
                    self.assertEqual(status, 4 if closed else 0, text)
                ran.append(words[1])
        self.assertEqual({name: ran.count(name) for name in set(ran)}, {"run": 7, "identify": 9, "optimize": 1})


if __name__ == "__main__":
    unittest.main()
