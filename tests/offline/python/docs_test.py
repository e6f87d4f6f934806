"""What docs/python.md shows is what Python answers."""

import doctest
import os
import sys

import support


class Page(support.WithFolder):
    def test_shows_what_python_answers(self):
        os.chdir(support.ROOT)
        page = str(support.ROOT / "docs/python.md")
        results = doctest.testfile(page, module_relative=False, optionflags=doctest.ELLIPSIS)
        self.assertGreater(results.attempted, 5)
        self.assertEqual(results.failed, 0)


if __name__ == "__main__":
    support.main(sys.argv)
