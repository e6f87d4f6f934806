"""Every requirement has its verification, every safety test and every mutation a requirement, and every hazard what
prevents or limits it.

usage: requirements_test.py ROOT BUILD CTEST    the project's folder, that of its build, and the program ctest
"""

import pathlib
import sys
import unittest

import requirements as r

GOOD = """
[[group]]
name = "Arming"
about = ""

[[group.requirement]]
id = "ARM-1"
promise = "Arming begins where the joints are."
tests = ["Executor.Arms", "Judge.*"]
mutations = ["executor.cc: if (arms"]

[[group.requirement]]
id = "ARM-2"
promise = "A proof will do."
proofs = ["GateProof.X86"]
"""
LISTING = {
    "tests": [
        {"name": "Executor.Arms", "command": ["/b/tests/core_test", "--gtest_filter=Executor.Arms"]},
        {"name": "Every/Judge.Sees/mit", "command": ["/b/tests/core_test", "--gtest_filter=Every/Judge.Sees/mit"]},
        {"name": "GateProof.X86", "command": ["/usr/bin/python3", "/p/proof.py"]},
    ]
}
MUTATIONS = "# Arming.\nruntime/executor/executor.cc :: if (arms()) return; => if (false) return;\n"


def no_list(program, chosen):
    raise AssertionError(f"{program} need not be asked")


class Requirements(unittest.TestCase):
    root = build = pathlib.Path()
    ctest = ""
    lacking = []  # what of the build's tests is not there, so that they could not be compared

    def problems(self, source=GOOD, listing=None, mutations=MUTATIONS, programs=("core_test",)):
        """All that is amiss with this source, beside these tests and mutations."""
        groups, problems = r.read(source)
        tests = r.tests_of_list(listing or LISTING, no_list)
        problems += r.problems_of_form(groups)
        problems += r.problems_of_tests(groups, tests, programs)
        return problems + r.problems_of_mutations(groups, r.mutations_of(mutations))

    def assert_only(self, problems, start, *parts):
        self.assertEqual(len(problems), 1, problems)
        self.assertTrue(problems[0].startswith(start), problems)
        for part in parts:
            self.assertIn(part, problems[0])

    # The project.

    def test_of_the_project_each_is_verified_and_each_safety_test_and_mutation_has_one(self):
        groups, problems = r.read((self.root / r.SOURCE).read_text())
        problems += r.problems_of_form(groups)
        problems += r.problems_of_mutations(groups, r.mutations_of((self.root / r.MUTATIONS).read_text()))
        problems += r.problems_of_hazards(groups, (self.root / r.HAZARDS).read_text())
        tests = r.tests_of_build(self.ctest, self.build)
        Requirements.lacking = tests.lacking
        if not tests.lacking:
            problems += r.problems_of_tests(groups, tests, r.safety_programs(self.root))
        self.assertEqual(problems, [], "\n" + "\n".join(problems))
        self.assertGreater(len(r.all_of(groups)), 0)

    def test_the_page_is_written_from_the_source(self):
        groups, _ = r.read((self.root / r.SOURCE).read_text())
        self.assertEqual((self.root / r.PAGE).read_text(), r.page(groups), "scripts/docs-tables writes it")

    def test_the_folders_of_safety_tests_declare_programs(self):
        programs = r.safety_programs(self.root)
        for program in ("core_test", "fault_matrix_test", "tumbler_ctl_test", "firmware_interface_test", "record_test"):
            self.assertIn(program, programs)

    # What the check finds.

    def test_with_good_ones_nothing_is_amiss(self):
        self.assertEqual(self.problems(), [])

    def test_a_test_that_does_not_exist_is_named_with_line_id_and_the_nearest(self):
        problems = self.problems(GOOD.replace("Executor.Arms", "Executor.Arm"), programs=())
        self.assert_only(problems, f"{r.SOURCE}:9: ARM-1: there is no test Executor.Arm;", "is it Executor.Arms?")

    def test_a_suite_that_does_not_exist_is_named(self):
        problems = self.problems(GOOD.replace("Judge.*", "Judges.*"), programs=())
        self.assert_only(problems, f"{r.SOURCE}:9: ARM-1: there is no test Judges.*")

    def test_only_a_whole_suite_is_named_at_once(self):
        problems = self.problems(GOOD.replace("Judge.*", "Judge.S*"), programs=())
        self.assert_only(problems, f"{r.SOURCE}:9: ARM-1: there is no test Judge.S*")

    def test_a_proof_that_does_not_exist_is_named(self):
        problems = self.problems(GOOD.replace("GateProof.X86", "GateProof.Arm"))
        self.assert_only(problems, f"{r.SOURCE}:15: ARM-2: there is no test GateProof.Arm")

    def test_a_requirement_without_verification_is_named(self):
        problems = self.problems(GOOD.replace('proofs = ["GateProof.X86"]', "tests = []"))
        self.assert_only(problems, f"{r.SOURCE}:12: ARM-2: is verified by no test and no proof")

    def test_a_mutation_alone_verifies_nothing(self):
        problems = self.problems(GOOD.replace('tests = ["Executor.Arms", "Judge.*"]', ""), programs=())
        self.assert_only(problems, f"{r.SOURCE}:6: ARM-1: is verified by no test and no proof")

    def test_a_safety_test_without_a_requirement_is_named_with_its_program(self):
        problems = self.problems(GOOD.replace(', "Judge.*"', ""))
        self.assert_only(problems, "core_test: Judge.Sees is a safety test that no requirement", r.SOURCE)

    def test_a_program_of_which_no_test_runs_is_named(self):
        problems = self.problems(programs=("core_test", "faults_test"))
        self.assert_only(problems, "faults_test: CTest runs no test of this program")

    def test_ids_are_unique_words_with_numbers(self):
        problems = self.problems(GOOD.replace("ARM-2", "ARM-1"))
        self.assert_only(problems, f"{r.SOURCE}:12: ARM-1: has the id of line 6")
        for wrong in ("arm-2", "ARM2", "ARM-", "ARM-2b"):
            problems = self.problems(GOOD.replace("ARM-2", wrong))
            self.assertIn(f"{r.SOURCE}:12: {wrong}: an id is", problems[-1], wrong)

    def test_a_group_has_ids_of_one_kind(self):
        problems = self.problems(GOOD.replace("ARM-2", "GATE-2"))
        self.assert_only(problems, r.SOURCE, "'Arming'", "ARM, GATE")

    def test_a_promise_is_a_sentence(self):
        for wrong in ("", "a proof will do.", "A proof will do"):
            problems = self.problems(GOOD.replace("A proof will do.", wrong))
            self.assert_only(problems, f"{r.SOURCE}:12: ARM-2: promise has to be a sentence")

    def test_what_stands_twice_is_named(self):
        problems = self.problems(GOOD.replace('"Judge.*"', '"Judge.*", "Judge.*"'))
        self.assert_only(problems, f"{r.SOURCE}:9: ARM-1: Judge.* stands twice in tests")

    def test_a_mutation_that_does_not_exist_is_named(self):
        problems = self.problems(GOOD.replace("if (arms", "if (armed"), mutations="")
        self.assert_only(problems, f"{r.SOURCE}:10: ARM-1: {r.MUTATIONS} breaks no such code: executor.cc: if (armed")

    def test_a_mutation_that_could_be_either_of_two_is_named(self):
        two = MUTATIONS + "runtime/executor/executor.cc :: if (arms(twice)) return; => return;\n"
        problems = self.problems(mutations=two)
        self.assertEqual(len(problems), 1)
        self.assert_only(problems, f"{r.SOURCE}:10: ARM-1: 2 mutations have this code")

    def test_a_mutation_that_is_part_of_another_is_named_by_all_of_its_code(self):
        two = MUTATIONS + "runtime/executor/executor.cc :: if (arms => if (!arms\n"
        both = GOOD.replace('["executor.cc: if (arms"]', '["executor.cc: if (arms", "executor.cc: if (arms())"]')
        self.assertEqual(self.problems(both, mutations=two), [])

    def test_a_mutation_without_a_requirement_is_named_with_its_line(self):
        more = MUTATIONS + "runtime/executor/safety.h :: limit() => plan()\n"
        problems = self.problems(mutations=more)
        self.assert_only(problems, f"{r.MUTATIONS}:3: no requirement in {r.SOURCE} names this mutation: safety.h: limit()")

    def test_keys_that_there_are_not_are_named(self):
        problems = self.problems(GOOD.replace("proofs = ", "test = []\nproofs = "))
        self.assert_only(problems, f"{r.SOURCE}:12: ARM-2: unknown key test")
        problems = self.problems("[[groups]]\n" + GOOD)
        self.assert_only(problems, f"{r.SOURCE}: unknown key groups")

    def test_what_is_no_toml_is_named_with_its_line(self):
        _, problems = r.read(GOOD.replace('id = "ARM-2"', "id = ARM-2"))
        self.assert_only(problems, r.SOURCE, "line 13")

    # The tests of a build.

    def test_of_an_entry_that_runs_a_whole_program_the_program_says_what_its_tests_are(self):
        entry = {"name": "Every/Judge", "command": ["sh", "-c", "$0 $1", "/b/tests/a_test", "--gtest_filter=Every/Judge.*"]}
        asked = []

        def says(program, chosen):
            asked.append((program, chosen))
            return "Control.\n  Stops\n  Starts\nEvery/Judge.\n  Sees/mit  # GetParam() = 8-byte object\n"

        tests = r.tests_of_list({"tests": [entry]}, says)
        self.assertEqual(asked, [("/b/tests/a_test", "--gtest_filter=Every/Judge.*")])
        self.assertEqual(tests.of_program, {"a_test": {"Control.Stops", "Control.Starts", "Judge.Sees"}})
        self.assertEqual(tests.lacking, [])

    def test_a_program_that_cannot_be_asked_is_not_built(self):
        def nobody(program, chosen):
            raise FileNotFoundError(program)

        tests = r.tests_of_list({"tests": [{"name": "Matrix", "command": ["/b/tests/matrix_test"]}]}, nobody)
        self.assertEqual(tests.lacking, ["matrix_test is not built"])

    def test_what_is_not_built_or_left_out_is_told(self):
        listing = {"tests": [{"name": "core_test_NOT_BUILT"}, {"name": "Dbc left out, needs python3-canmatrix"}]}
        tests = r.tests_of_list(listing, no_list)
        self.assertEqual(tests.lacking, ["core_test is not built", "Dbc left out, needs python3-canmatrix"])
        self.assertEqual(tests.names(), set())

    def test_names_are_without_instantiation_and_parameter(self):
        for name in ("A.B", "All/A.B", "A.B/mit", "All/A.B/mit_fault_3", "All/A/0.B", "A/0.B"):
            self.assertEqual(r.canonical(name), "A.B")

    # Hazards.

    def hazards(self, text):
        groups, _ = r.read(GOOD)
        return r.problems_of_hazards(groups, text.replace("REST", "- **Remains**: the rest."))

    def test_a_hazard_that_names_a_requirement_is_good(self):
        self.assertEqual(self.hazards("### H1. A joint moves\n\nIt is limited (ARM-1, ARM-2).\nREST\n"), [])

    def test_a_requirement_that_there_is_not_is_named(self):
        problems = self.hazards("### H1. A joint moves\n\nARM-1\nARM-7\nREST\n")
        self.assert_only(problems, f"{r.HAZARDS}:4: there is no requirement ARM-7")

    def test_a_hazard_that_names_none_is_named(self):
        problems = self.hazards("### H1. A joint moves\n\nARM-1\nREST\n### H2. It falls\nREST\n## More\nARM-1\n")
        self.assert_only(problems, f"{r.HAZARDS}:5: H2 names no requirement")

    def test_a_hazard_that_does_not_say_what_remains_is_named(self):
        problems = self.hazards("### H1. A joint moves\n\nARM-1\n\n### H2. It falls\n\nARM-1\nREST\n")
        self.assert_only(problems, f"{r.HAZARDS}:1: H1 does not say what remains")

    def test_a_hazard_that_stands_twice_and_a_page_without_any_are_named(self):
        problems = self.hazards("### H1. A joint moves\nARM-1\nREST\n### H1. It falls\nARM-1\nREST\n")
        self.assert_only(problems, f"{r.HAZARDS}:4: H1 stands there twice")
        self.assert_only(self.hazards("# Hazards\n"), f"{r.HAZARDS}: has no hazard")

    # The page.

    def test_a_page_has_each_with_its_verification(self):
        groups, _ = r.read(GOOD.replace("if (arms", "arms|").replace('about = ""', 'about = "How it begins."'))
        text = r.page(groups)
        self.assertIn("## Arming\n\nHow it begins.\n\n| id | promise |", text)
        self.assertIn("| ARM-1 | Arming begins where the joints are. | `Executor.Arms`, `Judge.*` | `executor.cc: arms\\|` |", text)
        self.assertIn("| ARM-2 | A proof will do. | `GateProof.X86` | |", text)


if __name__ == "__main__":
    Requirements.ctest = sys.argv.pop(3)
    Requirements.build = pathlib.Path(sys.argv.pop(2))
    Requirements.root = pathlib.Path(sys.argv.pop(1))
    passed = unittest.main(exit=False).result.wasSuccessful()
    if passed and Requirements.lacking:
        print("left out,", "; ".join(Requirements.lacking))
        sys.exit(77)
    sys.exit(not passed)
