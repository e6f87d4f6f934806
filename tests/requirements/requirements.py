"""The requirements of the runtime, the tests and mutations that verify them, and the hazards that they answer.

usage: requirements.py ROOT    writes ROOT/docs/requirements.md from tests/requirements/requirements.toml

`requirements_test.py` beside this file checks what is here against the build's tests.
"""

import dataclasses
import difflib
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import tomllib

SOURCE = "tests/requirements/requirements.toml"
PAGE = "docs/requirements.md"
HAZARDS = "docs/hazards.md"
MUTATIONS = "tests/mutations/mutations.txt"
# Every test of the programs that these folders declare is a safety test.
SAFETY_FOLDERS = ("tests/firmware_interface", "tests/runtime", "tests/flights")
PROGRAM = re.compile(r"^\s*tumbler_(?:test|googletest|network_test)\((\w+)", re.MULTILINE)
ID = re.compile(r"\b[A-Z][A-Z0-9]*-[0-9]+\b")
KEYS = {"id", "promise", "tests", "mutations", "proofs"}


@dataclasses.dataclass
class Requirement:
    id: str
    line: int
    promise: str
    tests: list
    mutations: list
    proofs: list
    lines: dict  # of each name in the lists

    def at(self, name=None):
        return f"{SOURCE}:{self.lines.get(name, self.line)}: {self.id}"


@dataclasses.dataclass
class Group:
    name: str
    about: str
    requirements: list


def read(text):
    """(groups, problems) of the text of a source. What cannot be read as TOML is one problem."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        return [], [f"{SOURCE}: {error}"]
    problems = [f"{SOURCE}: unknown key {key}; there are groups alone" for key in data if key != "group"]
    # The lines on which requirements begin, in their order.
    lines = text.splitlines()
    begins = [number for number, line in enumerate(lines, 1) if line.strip() == "[[group.requirement]]"]
    begins.append(len(lines) + 1)
    groups, place = [], 0
    for table in data.get("group", []):
        group = Group(table.get("name", ""), table.get("about", ""), [])
        groups.append(group)
        if not group.name:
            problems.append(f"{SOURCE}: a group has no name")
        for entry in table.get("requirement", []):
            begin, end = begins[place], begins[place + 1]
            place += 1
            lists = {key: entry.get(key, []) for key in ("tests", "mutations", "proofs")}
            named = [name for names in lists.values() for name in names]
            found = {
                name: next((n for n in range(begin, end) if json.dumps(name) in lines[n - 1]), begin)
                for name in named
            }
            item = Requirement(entry.get("id", "?"), begin, entry.get("promise", ""), lines=found, **lists)
            group.requirements.append(item)
            problems += [f"{item.at()}: unknown key {key}" for key in entry if key not in KEYS]
    return groups, problems


def all_of(groups):
    return [requirement for group in groups for requirement in group.requirements]


def problems_of_form(groups):
    """What is amiss with the requirements whatever tests there are."""
    problems, seen = [], {}
    for group in groups:
        prefixes = {item.id.rpartition("-")[0] for item in group.requirements}
        if len(prefixes) > 1:
            problems.append(f"{SOURCE}: group {group.name!r} has ids of several kinds: {', '.join(sorted(prefixes))}")
    for item in all_of(groups):
        if not ID.fullmatch(item.id):
            problems.append(f"{item.at()}: an id is a word in capitals, a hyphen and a number, such as ARM-3")
        if item.id in seen:
            problems.append(f"{item.at()}: has the id of line {seen[item.id]}")
        seen.setdefault(item.id, item.line)
        if not re.fullmatch(r"[A-Z].*[.]", item.promise):
            problems.append(f"{item.at()}: promise has to be a sentence, from a capital letter to a full stop")
        if not (item.tests or item.proofs):
            problems.append(f"{item.at()}: is verified by no test and no proof")
        for key in ("tests", "mutations", "proofs"):
            names = getattr(item, key)
            for name in sorted({name for name in names if names.count(name) > 1}):
                problems.append(f"{item.at(name)}: {name} stands twice in {key}")
    return problems


# Tests.


def canonical(name):
    """`Suite.Name` of a test: without the name of an instantiation and that of a parameter."""
    match = re.fullmatch(r"(?:[^/.]+/)?([A-Za-z]\w*)(?:/\d+)?\.(\w+)(?:/.*)?", name)
    return f"{match[1]}.{match[2]}" if match else name


def listed(text):
    """The tests in what a program says to --gtest_list_tests."""
    suite, names = "", []
    for line in text.splitlines():
        word = line.split("#")[0].rstrip()
        if line.startswith("  "):
            names.append(canonical(suite + word.strip()))
        elif word.endswith("."):
            suite = word
    return names


@dataclasses.dataclass
class Tests:
    """The tests of a build, by the names that `canonical` gives."""

    of_program: dict  # the names of each GoogleTest program
    entries: set  # those of CTest's entries
    lacking: list  # what is not built, or left out

    def names(self):
        return self.entries.union(*self.of_program.values())


def tests_of_list(listing, run_list):
    """The tests of CTest's list (--show-only=json-v1).

    run_list(program, filter): what the program says to --gtest_list_tests; FileNotFoundError where there is none. It is
    asked where one entry of CTest runs several tests of a program.
    """
    tests = Tests({}, set(), [])
    for entry in listing["tests"]:
        name = entry["name"]
        if name.endswith("_NOT_BUILT"):
            tests.lacking.append(name.removesuffix("_NOT_BUILT") + " is not built")
            continue
        if " left out, needs " in name:
            tests.lacking.append(name)
            continue
        tests.entries.add(canonical(name))
        command = entry.get("command", [])
        program = next((word for word in reversed(command) if re.search(r"/tests/\w+_test$", word)), None)
        if not program:
            continue
        chosen = next((word for word in command if word.startswith("--gtest_filter=")), "")
        of_program = tests.of_program.setdefault(pathlib.Path(program).name, set())
        if chosen and "*" not in chosen:
            of_program.add(canonical(name))
            continue
        try:
            of_program.update(listed(run_list(program, chosen)))
        except FileNotFoundError:
            tests.lacking.append(pathlib.Path(program).name + " is not built")
    return tests


def tests_of_build(ctest, build):
    def run(*command):
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    # In a folder of its own, since CTest begins its logs anew, and may be running these tests.
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / "CTestTestfile.cmake").write_text(f'subdirs("{pathlib.Path(build).resolve()}")\n')
        listing = json.loads(run(ctest, "--test-dir", folder, "--show-only=json-v1"))
    return tests_of_list(listing, lambda program, chosen: run(program, "--gtest_list_tests", *chosen.split()))


def safety_programs(root):
    """The test programs that the folders of safety tests declare."""
    files = sorted(file for folder in SAFETY_FOLDERS for file in (root / folder).rglob("CMakeLists.txt"))
    return [program for file in files for program in PROGRAM.findall(file.read_text())]


def claims(claim, name):
    """Whether a test is one that a requirement names: by its name, or with all tests of its suite."""
    return name == claim or claim.endswith(".*") and name.startswith(claim[:-1])


def nearest(name, names):
    close = difflib.get_close_matches(name, names, 1)
    return f"; is it {close[0]}?" if close else ""


def problems_of_tests(groups, tests, programs):
    names = tests.names()
    problems = []
    for item in all_of(groups):
        for claim in item.tests + item.proofs:
            if not any(claims(claim, name) for name in names):
                problems.append(f"{item.at(claim)}: there is no test {claim}{nearest(claim, names)}")
    named = [claim for item in all_of(groups) for claim in item.tests + item.proofs]
    for program in programs:
        if program not in tests.of_program:
            problems.append(f"{program}: CTest runs no test of this program")
        for name in sorted(tests.of_program.get(program, ())):
            if not any(claims(claim, name) for claim in named):
                problems.append(f"{program}: {name} is a safety test that no requirement in {SOURCE} names")
    return problems


# Mutations.


def mutations_of(text):
    """(file, code, line) of each mutation."""
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        if line and not line.startswith("#"):
            file, _, rest = line.partition(" :: ")
            found.append((pathlib.PurePosixPath(file).name, rest.partition(" => ")[0], number))
    return found


def problems_of_mutations(groups, mutations):
    """A requirement names a mutation by its file and a part of its code that no other mutation of the file has, or by all
    of its code."""
    problems, claimed = [], set()
    for item in all_of(groups):
        for claim in item.mutations:
            file, _, part = claim.partition(": ")
            of_file = {code for name, code, _ in mutations if name == file}
            meant = {part} if part in of_file else {code for code in of_file if part and part in code}
            if not meant:
                problems.append(f"{item.at(claim)}: {MUTATIONS} breaks no such code: {claim}")
            if len(meant) > 1:
                problems.append(f"{item.at(claim)}: {len(meant)} mutations have this code: {claim}")
            claimed.update((file, code) for code in meant)
    for file, code, line in mutations:
        if (file, code) not in claimed:
            problems.append(f"{MUTATIONS}:{line}: no requirement in {SOURCE} names this mutation: {file}: {code}")
    return problems


# Hazards.


def problems_of_hazards(groups, text):
    """Each hazard names requirements that prevent or limit it, all of which there are, and says what remains."""
    ids = {item.id for item in all_of(groups)}
    problems, hazards = [], {}
    hazard = None
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("#"):
            match = re.match(r"### (H\d+)\. ", line)
            hazard = match[1] if match else None
            if hazard in hazards:
                problems.append(f"{HAZARDS}:{number}: {hazard} stands there twice")
            if hazard:
                hazards[hazard] = (number, set(), [])
        found = ID.findall(line)
        problems += [f"{HAZARDS}:{number}: there is no requirement {name}" for name in found if name not in ids]
        if hazard:
            hazards[hazard][1].update(found)
            hazards[hazard][2].append(line)
    if not hazards:
        problems.append(f"{HAZARDS}: has no hazard; a heading is such as '### H1. A joint moves'")
    for hazard, (number, named, lines) in hazards.items():
        if not named & ids:
            problems.append(f"{HAZARDS}:{number}: {hazard} names no requirement that prevents or limits it")
        if not any(line.startswith("- **Remains**: ") for line in lines):
            problems.append(f"{HAZARDS}:{number}: {hazard} does not say what remains")
    return problems


# The page.


def code(text):
    return "`" + text.replace("|", "\\|") + "`"


def page(groups):
    count = len(all_of(groups))
    lines = [
        "# Requirements",
        "",
        f"Written by `scripts/docs-tables` from `{SOURCE}`: what the runtime promises, {count} sentences, and",
        "what shows that each is kept. The tests are those of CTest and GoogleTest, `Suite.Name` whatever the parameters,",
        "and `Suite.*` for all of a suite. A mutation is code that `scripts/mutate` breaks, and the tests have to notice",
        "([mutations.md](mutations.md)). Which requirements a person near the robot relies on is in [hazards.md](hazards.md);",
        "what a proof is worth, and what is trusted, in [assurance.md](assurance.md); which conditions of the core the tests",
        "have shown to matter, in [coverage.md](coverage.md).",
        "",
        "A test (`tests/requirements/`) fails when a requirement names a test, a proof or a mutation that does not exist, or",
        "names neither test nor proof; when a mutation, or a test of a program in",
        f"{' or '.join(f'`{f}/`' for f in SAFETY_FOLDERS)}, is named by no requirement; when a hazard",
        "names a requirement that does not exist, or none.",
    ]
    for group in groups:
        lines += ["", f"## {group.name}", ""]
        if group.about:
            lines += [group.about, ""]
        lines += ["| id | promise | proofs, tests | mutations |", "|---|---|---|---|"]
        for item in group.requirements:
            shown = [", ".join(map(code, names)) for names in (item.proofs + item.tests, item.mutations)]
            lines.append(f"| {item.id} | {item.promise} | {shown[0]} | {shown[1]} |".replace("|  |", "| |"))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    project = pathlib.Path(sys.argv[1])
    read_groups, amiss = read((project / SOURCE).read_text())
    if amiss:
        sys.exit("\n".join(amiss))
    (project / PAGE).write_text(page(read_groups))
