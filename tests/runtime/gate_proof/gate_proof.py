"""Proves what the last gate promises, of what clang makes of it, and shows that the proof notices a broken gate.

  gate_proof.py prove TARGET SOLVER...    TARGET: x86-64 or cortex-m; SOLVER: z3 or cvc5
  gate_proof.py mutants                   every mutation of the gate breaks a promise, or is known to change nothing
  gate_proof.py agree                     g++, clang and the translation to SMT-LIB mean the same
  gate_proof.py callers                   the gate is called as its promises suppose

What is proved, and what is supposed, is in docs/assurance.md.
"""

import os
import pathlib
import re
import resource
import struct
import subprocess
import sys
import tempfile

from gate_mutants import mutants, read_redundant
from llvm_to_smt import Function, conjunction, float_constant, integer_constant

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
CLANG = os.environ.get("TUMBLER_CLANG", "clang++-22")
ARM_GCC = os.environ.get("TUMBLER_ARM_CXX", "arm-none-eabi-g++")
GCC = os.environ.get("TUMBLER_GCC", "g++")
# The header that a build makes. The gate sees one joint, so that it does not matter of how many.
MADE = tempfile.TemporaryDirectory()
capacity = pathlib.Path(MADE.name, "common/core/capacity.h")
capacity.parent.mkdir(parents=True)
capacity.write_text((ROOT / "common/core/capacity.h.in").read_text().replace("@TUMBLER_MAX_JOINTS@", "12"))
# Of the release build. Tests are compiled as what is shipped is.
FLAGS = ["-std=c++20", "-O3", "-DNDEBUG", "-ffp-contract=off", f"-I{ROOT}", f"-I{MADE.name}"]
CORTEX_M = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-fno-exceptions", "-fno-rtti",
            "-fno-threadsafe-statics"]
TARGETS = ("x86-64", "cortex-m")
# Seconds of CPU for one question to a solver.
PATIENCE_S = 100


class Failed(Exception):
    pass


def run(command, **more):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, **more)
    if done.returncode != 0:
        raise Failed(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def target_flags(target):
    if target == "x86-64":
        return []
    # The headers of the cross-compiler's C++ library, as it would search them itself.
    listing = subprocess.run([ARM_GCC, *CORTEX_M, "-E", "-Wp,-v", "-xc++", "/dev/null"], capture_output=True,
                             text=True).stderr
    folders = re.findall(r"^ (/\S+)$", listing, re.M)
    return ["--target=thumbv7em-none-eabihf", *CORTEX_M, "-nostdinc", "-nostdinc++",
            *(word for folder in folders for word in ("-isystem", folder))]


def intermediate(source, target):
    """clang's intermediate representation of a source, after its optimisation."""
    return run([CLANG, *target_flags(target), *FLAGS, "-S", "-emit-llvm", "-o", "-", source])


# The gate.

LIMITS = ["position_min", "position_max", "velocity_max", "torque_max", "position_step", "torque_step"]
SETPOINT = ["position", "velocity", "torque"]
INPUTS = LIMITS + ["planned_" + name for name in SETPOINT] + ["previous_" + name for name in SETPOINT]


def floats(object_name, names):
    return object_name, [(4 * i, "float", name) for i, name in enumerate(names)], 4 * len(names)


def finite(x):
    return f"(not (or (fp.isNaN {x}) (fp.isInfinite {x})))"


def at_least(x, y):
    return f"(fp.geq {x} {y})"


def at_most(x, y):
    return f"(fp.leq {x} {y})"


def either(*terms):
    return f"(or {' '.join(terms)})"


def both(*terms):
    return f"(and {' '.join(terms)})"


def larger(x, y):
    return f"(ite (fp.gt {x} {y}) {x} {y})"


def smaller(x, y):
    return f"(ite (fp.lt {x} {y}) {x} {y})"


def magnitude(x):
    return f"(fp.abs {x})"


ZERO = float_constant(0)


class Gate:
    """LimitSetpoint as a compiler made it: `setpoint`, `changed` and `non_finite` of its inputs."""

    def __init__(self, text, function="Gate", base=None):
        self.function = Function(text, function, [
            floats("limits", LIMITS), floats("planned", ["planned_" + name for name in SETPOINT]),
            floats("previous", ["previous_" + name for name in SETPOINT]), "ticks", ("result", [], 14)],
            base and base.function)
        self.setpoint = [self.function.result("result", 4 * i, "float") for i in range(3)]
        self.changed = self.function.result("result", 12, "i8")
        self.non_finite = self.function.result("result", 13, "i8")

    def supposed(self):
        """What holds wherever the gate is called."""
        return [finite("position_min"), finite("position_max"), at_most("position_min", "position_max"),
                finite("velocity_max"), at_least("velocity_max", ZERO), finite("torque_max"),
                at_least("torque_max", ZERO),
                # A step may be infinite: that of a limit near the largest float.
                at_least("position_step", ZERO), at_least("torque_step", ZERO),
                *(finite("previous_" + name) for name in SETPOINT), "(bvsge ticks (_ bv1 32))"]

    def bounds(self):
        """The largest change of position and of torque, and where it leads from the previous ones. They are the terms of
        the function itself where the compiler computes them like this."""
        f = self.function
        ticks = f.define("Float32", "((_ to_fp 8 24) RNE ticks)")
        step, rise = (f.arithmetic("fmul", name, ticks) for name in ("position_step", "torque_step"))
        return (step, rise, f.arithmetic("fsub", "previous_position", step),
                f.arithmetic("fadd", "previous_position", step), f.arithmetic("fsub", "previous_torque", rise),
                f.arithmetic("fadd", "previous_torque", rise))

    def lemmas(self):
        """What is proved first, each with what was proved before it: a name, the statement, and the terms of which
        nothing else is used afterwards."""
        step, rise, low, high, weak, strong = self.bounds()
        return [("lemma_steps", both(at_least(step, ZERO), at_least(rise, ZERO)), {step, rise}),
                ("lemma_bounds", both(at_most(low, "previous_position"), at_most("previous_position", high),
                                      at_most(weak, "previous_torque"), at_most("previous_torque", strong)),
                 {low, high, weak, strong})]

    def promises(self):
        """Each promise by name."""
        f = self.function
        position, velocity, torque = self.setpoint
        _, _, low, high, weak, strong = self.bounds()
        planned = ["planned_" + name for name in SETPOINT]
        is_finite = both(*(finite(x) for x in planned))
        same = both(*(f"(fp.eq {x} {y})" for x, y in zip(self.setpoint, planned)))
        flag = {True: "(_ bv1 8)", False: "(_ bv0 8)"}
        return {
            "position": both(finite(position),
                             either(at_least(position, "position_min"), at_least(position, "previous_position")),
                             either(at_most(position, "position_max"), at_most(position, "previous_position"))),
            "velocity": both(finite(velocity), at_most(magnitude(velocity), "velocity_max")),
            "torque": both(finite(torque), either(at_most(magnitude(torque), "torque_max"),
                                                  at_most(magnitude(torque), magnitude("previous_torque")))),
            "position_step": both(at_least(position, low), at_most(position, high)),
            "torque_step": both(at_least(torque, weak), at_most(torque, strong)),
            "flags": both(f"(= {self.changed} (ite {same} {flag[False]} {flag[True]}))",
                          f"(= {self.non_finite} (ite {is_finite} {flag[False]} {flag[True]}))"),
            "no_more_than_needed": f"(=> {is_finite} " + both(
                self.nearest(planned[0], position, "position_min", "position_max", low, high),
                self.nearest(planned[1], velocity, "(fp.neg velocity_max)", "velocity_max", "(fp.neg velocity_max)",
                             "velocity_max"),
                self.nearest(planned[2], torque, "(fp.neg torque_max)", "torque_max", weak, strong)) + ")",
            "hold": either(is_finite, both(f"(fp.eq {position} previous_position)", f"(fp.isZero {velocity})",
                                           self.nearest(ZERO, torque, weak, strong, weak, strong))),
            "compiler": conjunction(f.obligations),
        }

    def nearest(self, x, y, a, b, c, d):
        """Whether y is the nearest to x of what limits [a, b] and steps [c, d] allow. The steps go first."""
        define = lambda term: self.function.define("Float32", term)
        top = define(larger(c, define(smaller(b, d))))
        bottom = define(smaller(d, define(larger(a, c))))
        return both(either(f"(not (fp.lt {y} {x}))", f"(fp.eq {y} {top})"),
                    either(f"(not (fp.gt {y} {x}))", f"(fp.eq {y} {bottom})"))


class Limits:
    """MakeSafetyLimits, for what IsPlayable lets through: what the gate supposes, and limits that are the joint's."""

    JOINT = ["joint_position_min", "joint_position_max", "joint_velocity_max", "joint_acceleration_max",
             "joint_torque_max"]

    def __init__(self, text):
        self.function = Function(text, "Limits", [floats("joint", self.JOINT), "period", "rise",
                                                  ("result", [], 24)])
        self.limits = [self.function.result("result", 4 * i, "float") for i in range(6)]

    def supposed(self):
        number = lambda x: float_constant(struct.unpack(">I", struct.pack(">f", x))[0])
        low, high, velocity, _, torque = self.JOINT
        return [finite(low), finite(high), f"(fp.lt {low} {high})", finite(velocity), f"(fp.gt {velocity} {ZERO})",
                finite(torque), f"(fp.gt {torque} {ZERO})",
                at_least("period", number(1e-5)), at_most("period", number(1)),
                at_least("rise", number(1e-6)), at_most("rise", number(1e3))]

    def lemmas(self):
        share = self.function.arithmetic("fdiv", "period", "rise")
        return [("lemma_share", at_least(share, ZERO), {share})]

    def promises(self):
        f = self.function
        low, high, velocity, _, torque = self.JOINT
        copied = zip(self.limits[:4], [low, high, velocity, torque])
        return {
            "limits_are_the_joints": both(*(f"(fp.eq {x} {y})" for x, y in copied)),
            # A plan that keeps its limit of velocity is not held back.
            "position_step": both(at_least(self.limits[4], ZERO),
                                  at_least(self.limits[4], f.arithmetic("fmul", velocity, "period"))),
            "torque_step": at_least(self.limits[5], ZERO),
            "compiler": conjunction(f.obligations),
        }


# Solvers.

def ask(solver, text, patience_s=PATIENCE_S):
    """The solver's answers, and the seconds of CPU that it took."""
    command = {"z3": ["z3", "-in"], "cvc5": ["cvc5", "--lang=smt2", "-"]}[solver]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, input=text, capture_output=True, text=True, preexec_fn=lambda: resource.setrlimit(
        resource.RLIMIT_CPU, (patience_s, patience_s)))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if "error" in done.stdout:
        raise Failed(f"{solver}: {done.stdout[:2000]}")
    return (done.stdout or "no answer in time").split("\n"), after.ru_utime - before.ru_utime


def script(declarations, *asserted, after=("(check-sat)",)):
    return "\n".join(["(set-logic QF_BVFP)", *declarations, *(f"(assert {term})" for term in asserted), *after, ""])


def prove(target, solvers):
    text = intermediate(HERE / "gate.cc", target)
    failed = False
    for name, subject in (("LimitSetpoint", Gate(text)), ("MakeSafetyLimits", Limits(text))):
        count = sum(subject.function.instructions.values())
        print(f"{name} for {target}, {count} instructions of clang's IR:")
        steps = subject.lemmas() + [(promise, term, set()) for promise, term in subject.promises().items()]
        supposed, unknown = subject.supposed(), set()
        # A contradiction would prove anything.
        (answer, *_), _ = ask("z3", script(subject.function.all_declarations(), *supposed))
        if answer != "sat":
            raise Failed(f"{name}: what is supposed contradicts itself: {answer}")
        for promise, term, settled in steps:
            for solver in solvers:
                (answer, *_), seconds = ask(solver, script(subject.function.all_declarations(unknown), *supposed,
                                                           f"(not {term})"))
                proved = answer == "unsat"
                failed |= not proved
                print(f"  {promise}: {'proved' if proved else 'NOT PROVED: ' + answer} by {solver} in {seconds:.1f} s of CPU",
                      flush=True)
            if settled:
                supposed.append(term)
                unknown |= settled
    if failed:
        raise Failed("not all is proved")


# Mutants.

def values_of(words):
    """SMT-LIB terms that fix the inputs to given bits."""
    terms = [f"(= {name} {float_constant(int(word, 16))})" for name, word in zip(INPUTS, words)]
    return terms + [f"(= ticks {integer_constant(int(words[12], 16), 32)})"]


def mutant_source(header, numbers, all_mutants):
    """One source with every mutant of the gate in a namespace of its own, after the gate itself (0)."""
    parts = ['#include "common/core/primitive.h"', '#include "common/core/realtime.h"', "#include <cstdint>"]
    strip = lambda text: re.sub(r"^#.*\n", "", text, flags=re.M)
    for i, (a, b) in enumerate([(header, numbers)] + [(m.header, m.numbers) for m in all_mutants]):
        for text in (b, a):
            parts.append(strip(text).replace("namespace tumbler {", f"namespace gate_{i} {{ using namespace tumbler;")
                         .replace("}  // namespace tumbler", "}"))
        parts.append(f"""extern "C" void Gate_{i}(const void* limits, const void* planned, const void* previous,
                                                   int ticks, void* result) noexcept {{
          using namespace gate_{i};
          *static_cast<LimitedSetpoint*>(result) = LimitSetpoint(
              *static_cast<const SafetyLimits*>(limits), *static_cast<const JointSetpoint*>(planned),
              *static_cast<const JointSetpoint*>(previous), ticks);
        }}""")
    count = 1 + len(all_mutants)
    parts.append("namespace tumbler { using GateFunction = void(const void*, const void*, const void*, int, void*);")
    parts.append("extern GateFunction* const kGates[]; GateFunction* const kGates[] = {" +
                 ", ".join(f"Gate_{i}" for i in range(count)) + ", nullptr}; }")
    return "\n".join(parts)


def check_mutants():
    header = (ROOT / "runtime/executor/safety.h").read_text()
    numbers = (ROOT / "runtime/executor/numbers.h").read_text()
    everything = mutants(header, numbers, ROOT / "tests/mutations/mutations.txt")
    redundant = read_redundant(HERE / "redundant.txt")
    seconds_before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    with tempfile.TemporaryDirectory() as folder:
        source = pathlib.Path(folder) / "mutants.cc"
        source.write_text(mutant_source(header, numbers, everything))
        program = pathlib.Path(folder) / "gate_search"
        run([CLANG, *FLAGS, "-fno-strict-aliasing", source, HERE / "gate_search.cc", "-o", program])
        texts = {target: intermediate(source, target) for target in TARGETS}
        found = {}
        for line in run([program, "200000", "1"]).splitlines():
            index, promise, *words = line.split()
            if promise != "none":
                found[int(index)] = (promise, words)
        if 0 in found:
            raise Failed(f"the gate itself breaks its promise `{found[0][0]}`: {' '.join(found[0][1])}")
        originals = {target: Gate(text, "Gate_0") for target, text in texts.items()}
        problems, counts = [], {"search": 0, "solver": 0, "redundant": 0}
        refutations = []
        for i, mutant in enumerate(everything, 1):
            gates = {target: Gate(text, f"Gate_{i}", originals[target]) for target, text in texts.items()}
            refutation = found.get(i)
            if refutation:
                counts["search"] += 1
            elif all(is_same(gate, originals[target]) for target, gate in gates.items()):
                counts["redundant"] += 1
                if mutant.text not in redundant:
                    problems.append(f"{mutant}: it changes nothing, and redundant.txt does not say why")
                else:
                    redundant[mutant.text].used = True
                continue
            else:
                refutation = violation(gates, i, program)
                counts["solver"] += 1
            if refutation:
                refutations.append((mutant, gates, *refutation))
            else:
                problems.append(f"{mutant}: neither refuted nor redundant")
        problems += [f"{mutant}: {' '.join(words)} breaks `{promise}` in compiled code, but not for {target}"
                     for mutant, target, promise, words in unconfirmed(refutations)]
    unused = [text for text, reason in redundant.items() if not reason.used]
    problems += [f"redundant.txt: {text}: no such mutant, or it is refuted" for text in unused]
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - seconds_before
    print(f"{len(everything)} mutants: {counts['search'] + counts['solver']} refuted ({counts['search']} by samples, "
          f"{counts['solver']} by z3), each for both targets and in compiled code; {counts['redundant']} change nothing, "
          f"as redundant.txt says why; {seconds:.0f} s of CPU")
    if problems:
        raise Failed("\n".join(problems))


def is_same(gate, original):
    """Whether two gates always give the same numbers and flags, by z3. The sign of a zero is not looked at."""
    pairs = list(zip([*gate.setpoint, gate.changed, gate.non_finite],
                     [*original.setpoint, original.changed, original.non_finite]))
    if all(x == y for x, y in pairs):
        return True  # The terms are the same.
    same = [f"(fp.eq {x} {y})" for x, y in pairs[:3]] + [f"(= {x} {y})" for x, y in pairs[3:]]
    supposed, unknown = original.supposed(), set()
    for _, term, settled in original.lemmas():
        supposed.append(term)
        unknown |= settled
    # What differs only where a bound is impossible counts as different, and will not be refuted.
    (answer, *_), _ = ask("z3", script(gate.function.all_declarations(unknown), *supposed, f"(not {both(*same)})"))
    return answer == "unsat"


def violation(gates, i, program):
    """A promise that mutant i breaks in compiled code, and for which input, by z3; None if there is none."""
    for gate in gates.values():
        broken = either(*(f"(not {term})" for term in gate.promises().values()))
        answers, _ = ask("z3", script(gate.function.all_declarations(), *gate.supposed(), broken,
                                      after=["(check-sat)", f"(get-value (ticks {' '.join(INPUTS)}))"]))
        if answers[0] == "sat":
            words = words_of(answers[1:])
            promise = run([program, str(i), *words]).strip()
            if promise != "none":
                return promise, words
    return None


def unconfirmed(refutations):
    """The refutations that do not hold in the translation for a target: (mutant, target, promise, words)."""
    for target in TARGETS:
        questions = []
        for _, gates, promise, words in refutations:
            gate = gates[target]
            term = gate.promises()[promise]  # It may define terms.
            questions.append(script(gate.function.all_declarations(), *gate.supposed(), *values_of(words),
                                    f"(not {term})"))
        answers, _ = ask("z3", "(reset)\n".join(questions))
        for (mutant, _, promise, words), answer in zip(refutations, answers):
            if answer != "sat":
                yield mutant, target, promise, words


def words_of(answers):
    """The bits of the inputs in z3's answer to (get-value (ticks ...)), in the order of gate_search's words."""
    text = " ".join(answers)
    special = {"+zero": 0, "-zero": 0x80000000, "+oo": 0x7f800000, "-oo": 0xff800000, "NaN": 0x7fc00000}
    words = {}
    for name, value in re.findall(r"\((ticks|\w+) (\(.*?\)|#\S+?)\)", text):
        if name == "ticks":
            words[name] = int(value[2:], 16 if value[1] == "x" else 2)
        elif value.startswith("(_"):
            words[name] = special[value.split()[1]]
        else:
            sign, exponent, fraction = re.findall(r"#[bx]\w+", value)
            number = lambda digits: int(digits[2:], 16 if digits[1] == "x" else 2)
            words[name] = number(sign) << 31 | number(exponent) << 23 | number(fraction)
    return [f"{words[name]:08x}" for name in INPUTS + ["ticks"]]


# The compilers that make what is shipped.

def samples_by(compiler, folder):
    """What a compiler's gate gives, as lines of gate_agree.cc."""
    program = pathlib.Path(folder) / "gate_agree"
    sources = [HERE / "gate_agree.cc", HERE / "gate.cc"]
    if compiler != ARM_GCC:
        run([compiler, *FLAGS, "-fno-strict-aliasing", *sources, "-o", program])
        return run([program])
    embedded = ROOT / "runtime/embedded"
    run([compiler, *CORTEX_M, *FLAGS, "-fno-strict-aliasing", "-ffunction-sections", *sources,
         embedded / "startup.cc", embedded / "semihosting.cc", "-nostartfiles", "-T", embedded / "cortex_m.ld",
         "-Wl,--gc-sections", "-o", program])
    # Its console is QEMU's standard error.
    return run(["sh", "-c", 'exec qemu-system-arm "$@" 2>&1', "sh", "-machine", "mps2-an386", "-display", "none", "-monitor",
                "none", "-serial", "none", "-semihosting-config", "enable=on,target=native", "-kernel", program])


def agree():
    with tempfile.TemporaryDirectory() as folder:
        by_compiler = {compiler: samples_by(compiler, folder) for compiler in (GCC, CLANG, ARM_GCC)}
    expected = by_compiler[GCC]
    for compiler, text in by_compiler.items():
        if text != expected:
            different = next((a, b) for a, b in zip(expected.split("\n"), text.split("\n")) if a != b)
            raise Failed(f"{GCC} and {compiler} differ:\n  {different[0]}\n  {different[1]}")
    samples = [line.split()[1:] for line in expected.split("\n") if line.startswith("sample")]
    for target in TARGETS:
        gate = Gate(intermediate(HERE / "gate.cc", target))
        # The sign of a zero is looked at, too: `=` tells zeros apart, and takes all NaN for one.
        questions = []
        for words in samples:
            results = [f"(= {x} {float_constant(int(word, 16))})" for x, word in zip(gate.setpoint, words[13:16])]
            flags = int(words[16], 16)
            results += [f"(= {gate.changed} (_ bv{flags & 255} 8))", f"(= {gate.non_finite} (_ bv{flags >> 8} 8))"]
            questions.append(script(gate.function.all_declarations(), *values_of(words), f"(not {both(*results)})"))
        answers, seconds = ask("z3", "(reset)\n".join(questions))
        for words, answer in zip(samples, answers):
            if answer != "unsat":
                raise Failed(f"compiled code and its translation for {target} differ: {' '.join(words)}: {answer}")
        print(f"{target}: the translation gives what g++'s code gives for {len(samples)} samples, by z3 in "
              f"{seconds:.1f} s of CPU")
    print(f"{', '.join(by_compiler)}: the same bits: {expected.split()[-2:]}")


# Where the gate is called.

# Everything in the sources that calls the gate, sets its limits or its previous setpoint, with why that keeps what is
# supposed of it.
CALLS = {
    # Limits that are set by the commissioning's bounds; the previous position is measured.
    "LimitSetpoint(gate, planned, previous_, 1).setpoint;",
    # Of the present tick: `advance` is clamped to 1 ... 1 + late_ticks_max, which IsPlayable keeps within 1000.
    "LimitSetpoint(joint.limits, record.planned, joint.commanded, elapsed);",
    # IsPlayable checks the joint's limits and both times as `Limits.supposed` has them.
    "joint.limits = MakeSafetyLimits(joint.motion->limits, config_.period_s, config_.torque_rise_s);",
    # Finite, as proved.
    "joint.commanded = limited.setpoint;",
    # Measured and seen to be finite, then clamped to finite limits.
    "joint.commanded = {position, 0, 0};",
    # Seen to be finite, then clamped to finite limits.
    "joint.commanded.position_rad = std::clamp(encoded.position_rad, joint.limits.position_min_rad, "
    "joint.limits.position_max_rad);",
}


def callers():
    pattern = re.compile(r"LimitSetpoint\(|[\w.>-]*\blimits = [^;=]*MakeSafetyLimits|[\w.>-]*\bcommanded(\.\w+)? (?:[-+*/]?=)(?!=)")
    found = set()
    for path in sorted(path for folder in ("runtime", "offline", "firmware_interface", "common")
                       for path in (ROOT / folder).rglob("*") if path.suffix in (".cc", ".h")):
        if path.name in ("safety.h", "safety.cc"):
            continue
        text = re.sub(r"//.*", "", path.read_text())
        for match in pattern.finditer(text):
            if "commanded" in match.group(0) and "runtime/executor" not in str(path):
                continue
            if text[:match.start()].rsplit("\n", 1)[-1].strip().startswith("#"):
                continue
            found.add(" ".join(text[match.start():text.index(";", match.start()) + 1].split()))
    problems = [f"not looked at yet: {call}" for call in sorted(found - CALLS)]
    problems += [f"not there any more: {call}" for call in sorted(CALLS - found)]
    if problems:
        raise Failed("callers of the gate:\n" + "\n".join(problems))
    print(f"{len(found)} places that call the gate or say what it is called with, all of them known")


def main(arguments):
    actions = {"prove": lambda target, *solvers: prove(target, solvers), "mutants": check_mutants, "agree": agree,
               "callers": callers}
    if not arguments or arguments[0] not in actions:
        print(__doc__, file=sys.stderr)
        return 1
    try:
        actions[arguments[0]](*arguments[1:])
    except Failed as failure:
        print(failure, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
