"""Mutations of the last gate: one change each, of every operator, operand and statement of it."""

import re


class Mutant:
    """Both headers, one of them changed. `text` says how, by the statement that was changed, before and after."""

    def __init__(self, text, header, numbers):
        self.text = text
        self.header = header
        self.numbers = numbers

    def __str__(self):
        return self.text


class Reason:
    """Why a mutation changes nothing."""

    def __init__(self, text):
        self.text = text
        self.used = False


def read_redundant(path):
    """The mutations that change nothing, each with the reason in the comment before it."""
    redundant, reason = {}, ""
    for line in path.read_text().splitlines():
        if line.startswith("#"):
            reason = (reason + " " if reason else "") + line.lstrip("# ")
        elif line:
            redundant[line] = Reason(reason)
        else:
            reason = ""
    return redundant


def span_of(text, begin, end):
    start = text.index(begin)
    return start, text.index(end, start) + len(end)


def mutants(header, numbers, shared_list):
    """Mutants of LimitSetpoint and of the functions of numbers.h that it calls, and those of scripts/mutate."""
    found = {}

    def change(source, start, end, new):
        """Replaces source[start:end], which is in one of the headers."""
        mutated = source[:start] + new + source[end:]
        if mutated == source:
            return
        # The statement, for the mutation's name: from the last end of one to the next.
        first = max(source.rfind(mark, 0, start) for mark in (";\n", "{\n", "}\n")) + 2
        last = min(i for i in (source.find(mark, max(start, end - 1)) for mark in (";", "{\n")) if i >= 0) + 1
        before, after = source[first:last], source[first:start] + new + source[end:last]
        squeeze = lambda text: " ".join(re.sub(r"//.*", "", text).split())
        text = f"{squeeze(before)} => {squeeze(after)}"
        pair = (mutated, numbers) if source is header else (header, mutated)
        found.setdefault(text, Mutant(text, *pair))

    body = span_of(header, "  const auto ticks =", "  return result;")
    parts = [(header, *body)]
    for begin in ("constexpr float ZeroIfFinite", "constexpr bool AreFinite", "constexpr float ClampOrLow"):
        start = numbers.index("{\n", numbers.index(begin))
        parts.append((numbers, start, numbers.index("\n}", start)))
    for source, start, end in parts:
        operators(source, start, end, change)
        operands(source, start, end, change)
    statements(header, *body, change)
    calls(header, *body, change)

    for line in shared_list.read_text().splitlines():
        file, _, rest = line.partition(" :: ")
        before, _, after = rest.partition(" => ")
        for name, source in (("runtime/executor/safety.h", header), ("runtime/executor/numbers.h", numbers)):
            if file == name:
                at = source.index(before)
                change(source, at, at + len(before), after)
    return list(found.values())


def each(pattern, source, start, end):
    """Matches in the code of a part, not in its comments."""
    for match in re.finditer(pattern, source[start:end]):
        line = source.rfind("\n", 0, start + match.start()) + 1
        if "//" not in source[line:start + match.start()]:
            yield match, start + match.start(), start + match.end()


def operators(source, start, end, change):
    comparisons = ["<", "<=", ">", ">=", "==", "!="]
    for match, a, b in each(r"(?<= )(<=?|>=?|==|!=)(?= )", source, start, end):
        setpoints = source[:a].endswith("limited ")  # They can only be equal or not.
        for other in ("==", "!=") if setpoints else comparisons:
            change(source, a, b, other)
    for match, a, b in each(r"(?<= )[-+*](?= )", source, start, end):
        for other in "+-*":
            if "..." not in source[a - 4:b + 4]:
                change(source, a, b, other)
    for match, a, b in each(r"(?<=[ (])[-!](?=[\w(])", source, start, end):
        change(source, a, b, "")
    for match, a, b in each(r"\? (.*?) : (.*?);", source, start, end):
        change(source, a, b, f"? {match.group(2)} : {match.group(1)};")
        change(source, a, b, f"? {match.group(1)} : {match.group(1)};")
        change(source, a, b, f"? {match.group(2)} : {match.group(2)};")


def operands(source, start, end, change):
    quantities = ["position_rad", "velocity_rad_s", "torque_nm"]
    limits = ["position_min_rad", "position_max_rad", "velocity_max_rad_s", "torque_max_nm", "position_step_rad",
              "torque_step_nm"]
    for match, a, b in each(r"\b(planned|previous|limited)\.(\w+)", source, start, end):
        for quantity in quantities:
            change(source, a, b, f"{match.group(1)}.{quantity}")
        assigned = re.match(r"\s*=[^=]", source[b:])
        for setpoint in () if assigned else ("planned", "previous", "limited"):
            change(source, a, b, f"{setpoint}.{match.group(2)}")
    for match, a, b in each(r"\blimits\.(\w+)", source, start, end):
        for limit in limits:
            change(source, a, b, f"limits.{limit}")
        change(source, a, b, "0.0F")
        change(source, a, b, "3e38F")
    for match, a, b in each(r"\b(position_step|torque_step)\b(?! =)", source, start, end):
        for other in ("position_step", "torque_step", "0.0F", f"2 * {match.group(0)}", f"0.999F * {match.group(0)}",
                      f"1.001F * {match.group(0)}"):
            change(source, a, b, other)
    for match, a, b in each(r"\bticks\b(?! =)", source, start, end):
        change(source, a, b, "1.0F")
        change(source, a, b, "(ticks + 1)")
    for match, a, b in each(r"\b0\.0F\b", source, start, end):
        change(source, a, b, "1.0F")
    for match, a, b in each(r"\b(x|y|low|high)\b(?! =)", source, start, end):
        for other in ("x", "y", "low", "high"):
            if source[:a].rfind("ClampOrLow") > source[:a].rfind("AreFinite(Floats"):
                declared = source.find(f"const float {other} =", start, a) >= 0 or other != "y"
                if declared and f"const float {other} = " not in source[source.rfind("\n", 0, a):a]:
                    change(source, a, b, other)


def statements(source, start, end, change):
    for match, a, b in each(r"  (?:limited\.\w+|limited|result\.\w+) =[^;]*;", source, start, end):
        change(source, a, b, ";")
    for match, a, b in each(r"\btrue\b", source, start, end):
        change(source, a, b, "false")
    for match, a, b in each(r"if \((.*?)\) \{", source.replace("\n", " "), start, end):
        for condition in ("true", "false"):
            change(source, a, b, f"if ({condition}) {{")
    match = re.search(r"if \((![^;]*?)\) \{", source[start:end])
    for condition in ("true", "false"):
        change(source, start + match.start(1), start + match.end(1), condition)


def calls(source, start, end, change):
    for match, a, b in each(r"ClampOrLow\(([^;]*?)\)(?=[;}])", source, start, end):
        x, low, high = (" ".join(part.split()) for part in match.group(1).split(","))
        for new in (x, low, high, f"ClampOrLow({x}, {high}, {low})", f"ClampOrLow({x}, {low}, 3e38F)",
                    f"ClampOrLow({x}, -3e38F, {high})", f"ClampOrLow({low}, {x}, {high})"):
            change(source, a, b, new)
    for match, a, b in each(r"AreFinite\(([^;]*?)\)(?=\) \{)", source, start, end):
        arguments = [" ".join(part.split()) for part in match.group(1).split(",")]
        for i in range(len(arguments)):
            change(source, a, b, f"AreFinite({', '.join(arguments[:i] + arguments[i + 1:])})")
