"""Holds the .dbc files against the codecs.

Reads the lines of dbc_frames on standard input, decodes every frame with canmatrix as the file says,
and compares with what the codec read from it. Every message and every signal of the files has to
occur. usage: dbc_frames | dbc_check.py FOLDER_OF_DBC_FILES
"""

import contextlib
import io
import pathlib
import sys
import warnings

warnings.simplefilter("ignore")
with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
    import canmatrix.formats  # Says which formats it lacks.


def main(folder):
    files = {}
    seen = set()
    wrong = []
    count = 0
    for line in sys.stdin:
        dbc, message, identifier, data, *signals = line.split()
        if dbc not in files:
            files[dbc] = canmatrix.formats.loadp_flat(f"{folder}/{dbc}.dbc")
        frame = files[dbc].frame_by_name(message)
        if frame is None:
            wrong.append(f"{dbc}: has no message {message}")
            break
        data = b"" if data == "-" else bytes.fromhex(data)
        meant = {name: float(value) for name, value in (s.split("=") for s in signals)}
        extended = identifier.endswith("x")
        number = int(identifier.rstrip("x"))
        meant_id = frame.arbitration_id
        if (meant_id.id, bool(meant_id.extended)) != (number, extended) or frame.size != len(data):
            kind = "29-bit " if extended else ""
            wrong.append(f"{dbc}: {message} is {kind}0x{number:x} with {len(data)} bytes")
        decoded = frame.decode(bytearray(data)) if data else {}
        read = {name: float(value.phys_value) for name, value in decoded.items()}
        if set(read) != set(meant):
            wrong.append(f"{dbc}: {message} has {sorted(read)}, the codec {sorted(meant)}")
        for name in set(read) & set(meant):
            if abs(read[name] - meant[name]) > 2e-6 * max(1, abs(meant[name])):
                wrong.append(f"{dbc}: {message}.{name} reads {read[name]}, the codec {meant[name]}")
        seen.add((dbc, message))
        count += 1
    for path in pathlib.Path(folder).glob("*.dbc"):
        if path.stem not in files:
            wrong.append(f"{path.stem}: no protocol has frames of it")
    for dbc, database in files.items():
        for frame in database.frames:
            if (dbc, frame.name) not in seen:
                wrong.append(f"{dbc}: {frame.name} was not among the frames")
    for problem in wrong[:20]:
        print(problem)
    print(f"{count} frames of {len(seen)} messages in {len(files)} files, {len(wrong)} wrong")
    return 1 if wrong or count < 1000 else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
