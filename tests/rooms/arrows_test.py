"""Every #include of the product's folders against the table of arrows in docs/architecture.md.

usage: arrows_test.py ROOT    the project's folder
"""

import pathlib
import re
import sys
import tempfile
import unittest

HALVES = ("common", "firmware_interface", "runtime", "offline")
ROW = re.compile(r"^\| `([a-z_/]+)` \|(.*)\|$", re.MULTILINE)
INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)


def read_table(root):
    """The folders that each folder sees, in the order of the table."""
    text = (root / "docs/architecture.md").read_text()
    table = text.split("<!-- arrows: begin -->")[1].split("<!-- arrows: end -->")[0]
    return {folder: re.findall(r"`([a-z_/]+)`", sees) for folder, sees in ROW.findall(table)}


def is_within(folder, other):
    return folder == other or folder.startswith(other + "/")


def problems_of_table(table):
    """A folder that sees a row below its own, or half of the rows of a folder that it names."""
    order = list(table)
    problems = []
    for place, folder in enumerate(order):
        for seen in table[folder]:
            below = [row for row in order[place:] if is_within(row, seen)]
            if below or seen not in order:
                problems.append(f"{folder}: sees {seen}, which is not above it in the table")
    return problems


def arrows(root):
    """(folder, seen folder, file, line) of every #include that leaves its folder."""
    for half in HALVES:
        for file in sorted((root / half).rglob("*")):
            if file.suffix not in (".h", ".cc"):
                continue
            folder = str(file.parent.relative_to(root))
            text = file.read_text()
            for include in INCLUDE.finditer(text):
                seen = str(pathlib.PurePosixPath(include[1]).parent)
                if is_within(seen, folder) and seen == folder or seen == ".":
                    continue  # Its own folder, or a file that is generated.
                yield folder, seen, file.relative_to(root), text.count("\n", 0, include.start(1)) + 1


def wrong_arrows(root):
    table = read_table(root)
    problems = problems_of_table(table)
    seen_by = {}
    for folder, seen, file, line in arrows(root):
        seen_by.setdefault(folder, set()).add(seen)
        if folder not in table:
            problems.append(f"{file}:{line}: {folder} has no row in the table")
        elif not any(is_within(seen, allowed) for allowed in table[folder]):
            problems.append(f"{file}:{line}: {folder} does not see {seen}")
        if folder in seen_by.get(seen, ()):
            problems.append(f"{file}:{line}: {folder} and {seen} include each other")
    return problems


class Arrows(unittest.TestCase):
    root = pathlib.Path()

    def tree(self, table, files):
        """A small project: rows of the table, and the text of files by their paths."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        root = pathlib.Path(folder.name)
        rows = "".join(f"| `{name}` | {', '.join(f'`{s}`' for s in sees)} |\n" for name, sees in table)
        files = {"docs/architecture.md": f"<!-- arrows: begin -->\n{rows}<!-- arrows: end -->\n", **files}
        for path, text in files.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text)
        return root

    def test_of_the_project_all_go_the_way_that_the_table_says(self):
        self.assertEqual(wrong_arrows(self.root), [])

    def test_every_folder_of_the_table_is_there(self):
        for folder in read_table(self.root):
            self.assertTrue((self.root / folder).is_dir(), folder)

    def test_there_are_at_most_twenty_rooms_each_of_which_the_page_explains(self):
        rooms = read_table(self.root)
        self.assertLessEqual(len(rooms), 20)
        described = (self.root / "docs/architecture.md").read_text().split("## Dependencies")[0]
        for room in rooms:
            half, name = room.split("/")
            line = re.search(rf"^      {name}/ +(\S.*)$", described.split(f"    {half}/\n")[1], re.MULTILINE)
            self.assertTrue(line, room)
            for header in re.findall(r"\b\w+\.h\b", line[1].split(":")[0]):
                self.assertTrue((self.root / room / header).exists(), f"{room}/{header}")

    def test_only_these_rooms_see_both_halves(self):
        meet = {f"offline/{room}" for room in ("twin", "pages", "studies", "python", "programs")}
        for folder, sees in read_table(self.root).items():
            sides = {s.split("/")[0] for s in [folder, *sees]}
            both = "offline" in sides and sides & {"runtime", "firmware_interface"}
            self.assertFalse(both and folder not in meet, folder)

    def test_one_that_the_table_does_not_have_is_found(self):
        root = self.tree([("common", []), ("runtime", [])], {"runtime/a.cc": '\n#include "common/b.h"\n'})
        self.assertEqual(wrong_arrows(root), ["runtime/a.cc:2: runtime does not see common"])

    def test_two_folders_that_include_each_other_are_found(self):
        root = self.tree([("common", []), ("runtime", ["common"])],
                         {"common/b.h": '#include "runtime/a.h"\n', "runtime/a.h": '#include "common/b.h"\n'})
        self.assertIn("runtime/a.h:1: runtime and common include each other", wrong_arrows(root))

    def test_a_table_that_goes_round_is_found(self):
        root = self.tree([("common", ["runtime"]), ("runtime", ["common"])], {})
        self.assertEqual(wrong_arrows(root), ["common: sees runtime, which is not above it in the table"])

    def test_a_folder_without_a_row_is_found(self):
        root = self.tree([("common", [])], {"runtime/a.cc": '#include "common/b.h"\n'})
        self.assertEqual(wrong_arrows(root), ["runtime/a.cc:1: runtime has no row in the table"])


if __name__ == "__main__":
    Arrows.root = pathlib.Path(sys.argv.pop(1))
    unittest.main()
