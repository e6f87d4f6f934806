"""The commands that the pages for users show run as they stand there, from the project's folder."""

import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(sys.argv.pop(1)).resolve()
PAGES = [
    "README.md",
    "docs/generating.md",
    "docs/simulation.md",
    "docs/README.md",
    "docs/commissioning.md",
    "docs/driving.md",
    "docs/robustness.md",
]

if len(sys.argv) > 1 and sys.argv[1].startswith("docs/"):
    PAGES = [sys.argv.pop(1)]  # one that takes longer, by itself

# What no test can run as it stands, or another test does.
ELSEWHERE = {
    r"\bv?can0\b": "needs an interface: tests/runtime/*_on_can_test.cc",
    r"^scripts/": "builds the project",
    r"TASK\.toml|ROBOT\.urdf|MOTION|PRIMITIVE|robot_as_it_is": "has a name to be filled in",
    r"--out (primitives/|\w+_sensor)": "takes minutes: scripts/generate-primitives",
    r"--robots 1000 --cycles": "takes minutes: a figure of the document",
    r"^cmake ": "builds the project",
    r"--realtime": "runs at the pace of the clock",
    r"^candump": "needs an interface",
}
# Commands that are to end with another status than 0.
STATUSES = {
    "--bus-faults": 3,  # the bus is off in the end, as the file says
    "weak.toml --record": 3,
    "first.rec": 4,  # the robot that nobody knows falls
    "gate primitives/handstand.toml": 4,
}


def commands(page):
    """The commands of all indented blocks and of tables, in their order; continued lines are joined."""
    found, block, output = [], "", False
    for line in (ROOT / page).read_text().splitlines():
        if line.startswith("```"):
            output = not output
        if output or not line.startswith("    ") or line.startswith("     "):
            if not block:
                continue
        if line.startswith("    # ") and not block:
            continue
        block += line.strip()
        if block.endswith("\\"):
            block = block[:-1]
        elif block.endswith("|"):
            block += " "
        else:
            found.append(block)
            block = ""
    # Those of a table of purposes.
    found += re.findall(r"^\| [^|]* \| `(build/[^`|]*)` \|", (ROOT / page).read_text(), re.M)
    return found


class Pages(unittest.TestCase):
    def test_every_command_of_a_page_runs_or_is_run_elsewhere(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            for name in ("primitives", "tests", "scripts", "docs"):
                (folder / name).symlink_to(ROOT / name)
            (folder / "build/release").mkdir(parents=True)
            (folder / "build/release/bin").symlink_to(BIN)
            ran = set()  # a page may begin with what another one made
            for page in PAGES:
                for command in commands(page):
                    if command in ran or any(re.search(pattern, command) for pattern in ELSEWHERE):
                        continue
                    self.assertRegex(command, r"^(build/release/bin/|printf |echo |sed )", page)
                    done = subprocess.run(
                        ["bash", "-c", command], cwd=folder, capture_output=True, text=True
                    )
                    status = next((s for part, s in STATUSES.items() if part in command), 0)
                    self.assertEqual(
                        done.returncode, status, f"{page}: {command}\n{done.stdout}{done.stderr}"
                    )
                    ran.add(command)
            self.assertGreater(len(ran), 9 if len(PAGES) == 1 else 12)

    def test_the_list_of_pages_reads_only_what_its_own_commands_have_made(self):
        # Commands that begin a page must not need another page's.
        made = set(re.findall(r"build/[\w./]+", (ROOT / "scripts/demo").read_text()))
        count = 0
        for command in commands("docs/README.md"):
            words = command.split()
            for before, word in zip(words, words[1:]):
                if not word.startswith("build/"):
                    continue
                count += 1
                if before.startswith("--"):
                    made.add(word)
                else:
                    self.assertIn(word, made, command)
        self.assertGreater(count, 8)

    def test_shares_of_robots_in_lanes_are_those_of_the_page(self):
        page = (ROOT / "docs/robustness.md").read_text()
        rows = re.findall(
            r"^\| `(tumbler robustness [^`]*)` \| ([\d.]+) % \| ([\d.]+) \.\.\. ([\d.]+) % \| (\d+) \|",
            page,
            re.M,
        )
        # The others are the same program for longer.
        quick = [
            row
            for row in rows
            if "--lanes" in row[0]
            and "--cycles" not in row[0]
            and int(re.search(r"--robots (\d+)", row[0])[1]) <= 4000
        ]
        self.assertGreater(len(quick), 2)
        for command, share, least, most, fell in quick:
            said = subprocess.run(
                [BIN / "tumbler", *command.split()[1:], "--quiet"],
                cwd=ROOT,
                capture_output=True,
                text=True,
                check=True,
            ).stdout
            self.assertIn(f"{share} % (95 %: {least} ... {most} %)", said, command)
            falls = re.search(r"fell (\d+)", said)  # Nothing is said of none.
            self.assertEqual(falls[1] if falls else "0", fell, command)
        first = re.search(r"--seed 11 --lanes \\\n +--report build/robots\n\nsays that ([\d.]+) %", page)
        self.assertIn(first[1], [row[1] for row in quick if "--robots 1000 " in row[0]])

    def test_windows_of_the_ground_are_those_of_the_page(self):
        page = (ROOT / "docs/robustness.md").read_text()
        rows = re.findall(
            r"^\| `(tumbler robustness [^`]* --window)` \| ([^|]*) \| ([^|]*) \| ([^|]*) \| lanes \|$", page, re.M
        )
        self.assertGreater(len(rows), 8)
        # The others are the same program for longer.
        for command, friction, stiffness, damping in rows[:2]:
            said = subprocess.run(
                [BIN / "tumbler", *command.split()[1:]],
                cwd=ROOT,
                capture_output=True,
                text=True,
                check=True,
            ).stdout
            self.assertIn(f"friction   {friction} (task", said, command)
            self.assertIn(f"stiffness  {stiffness} N/m (task", said, command)
            self.assertIn(f"damping    {damping} N s/m (task", said, command)

    def test_every_option_of_every_program_is_named(self):
        pages = "".join(page.read_text() for page in [ROOT / "README.md", *ROOT.glob("docs/**/*.md")])
        count = 0
        overview = subprocess.run([BIN / "tumbler"], capture_output=True, text=True, check=True).stdout
        for program in re.findall(r"^  ([a-z]+) ", overview, re.M):
            def help_of(*subcommand):
                return subprocess.run(
                    [BIN / "tumbler", program, *subcommand, "--help"], capture_output=True, text=True, check=True
                ).stdout
            whole = help_of()
            commands = re.findall(r"^  ([a-z]\S*) ", whole.partition("\nCommands:\n")[2], re.M)
            for said in [whole] + [help_of(command) for command in commands]:
                for option in re.findall(r"^ +(?:-\w, )?(--[\w-]+)", said, re.M):
                    count += 1
                    if option not in ("--help", "--version"):
                        self.assertRegex(pages, rf"{option}\b", program)
        self.assertGreater(count, 150)

    def test_variables_of_the_environment_are_named(self):
        page = (ROOT / "docs/architecture.md").read_text()
        names = set()
        for folder in ("common", "firmware_interface", "runtime", "offline"):
            for source in (ROOT / folder).rglob("*.cc"):
                text = source.read_text()
                if "std::getenv(" in text:
                    names |= set(re.findall(r'"([A-Z]+(?:_[A-Z]+)+|HOME)"', text))
        self.assertGreater(len(names), 5)
        for name in names:
            self.assertIn(f"`{name}`", page)


if __name__ == "__main__":
    unittest.main()
