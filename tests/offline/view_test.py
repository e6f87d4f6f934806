"""tumbler view in a browser, with runs and records: view_test.py SOURCES PROGRAMS [TEST...]

Has to run in a network namespace of its own, with a loopback that takes multicast."""

import csv
import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request

import jsonschema

SOURCES, PROGRAMS = sys.argv[1:3]
sys.path.insert(0, os.path.join(SOURCES, "tests/support"))
from page_browser import Browser  # noqa: E402  the folder is known only now

GROUP, PORT = "239.255.76.67", 7667
URL = f"udpm://{GROUP}:{PORT}?ttl=0"
GAIT = os.path.join(SOURCES, "primitives/nominal/gait.toml")
STOP, DISARM = 5, 6


def command(name, *arguments):
    """The words of a command such as `tumbler run`."""
    program, *words = name.split()
    return [os.path.join(PROGRAMS, program), *words, *arguments]


def run(*arguments):
    return subprocess.run(command(*arguments), capture_output=True, text=True, timeout=120)


class Beside:
    """A program that runs beside the test."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True)

    def end(self, how=signal.SIGINT):
        if self.process.poll() is None:
            self.process.send_signal(how)
        rest, _ = self.process.communicate(timeout=60)
        return self.process.returncode, rest


class View(Beside):
    def __init__(self, *arguments):
        super().__init__("tumbler view", *arguments, "--port", "0")
        line = self.process.stdout.readline()
        assert "http://" in line, line
        self.url = line.split()[-1]
        self.port = int(re.search(r":(\d+)/", self.url).group(1))
        self.path = self.url.split(str(self.port))[1]

    def memory_kb(self):
        """@returns the most memory that it had; 0 where sanitizers have more of it than the program."""
        if os.environ.get("TUMBLER_SANITIZED"):
            return 0
        with open(f"/proc/{self.process.pid}/status") as status:
            return int(re.search(r"VmHWM:\s+(\d+)", status.read()).group(1))

    def ask(self, path, headers=None, method="GET", address="127.0.0.1", body=b""):
        """@returns the status of the answer."""
        request = urllib.request.Request(f"http://{address}:{self.port}{path}", method=method, headers=headers or {},
                                         data=body if method == "POST" else None)
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                return answer.status
        except urllib.error.HTTPError as error:
            error.close()
            return error.code


class Multicast:
    """Datagrams of LCM."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self.socket.bind(("", PORT))
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                               socket.inet_aton(GROUP) + socket.inet_aton("127.0.0.1"))
        self.socket.settimeout(20)

    def send(self, channel, data):
        self.socket.sendto(struct.pack(">II", 0x4C433032, 1) + channel.encode() + b"\0" + data, (GROUP, PORT))

    def next(self):
        while True:
            datagram = self.socket.recv(65536)
            if datagram[:4] == b"LC02":
                channel, data = datagram[8:].split(b"\0", 1)
                return channel.decode(), data

    def wait(self, channel):
        while True:
            name, data = self.next()
            if name == channel:
                return data


def text(value):
    return struct.pack(">i", len(value) + 1) + value + b"\0"


class OfARecord(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.record = os.path.join(cls.folder.name, "gait.rec")
        cls.trace = os.path.join(cls.folder.name, "gait.csv")
        done = run("tumbler run", "sim", GAIT, "--cycles", "1", "--record", cls.record, "--csv", cls.trace)
        assert done.returncode == 0, done.stdout + done.stderr
        cls.view = View(cls.record)
        cls.browser = Browser()

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.view.end()
        cls.folder.cleanup()

    def test_shows_the_instant_that_its_address_names(self):
        self.browser.go(self.view.url + "#t=0.4")
        self.assertEqual(self.browser.value("document.getElementById('errors').hidden"), True)
        seconds = float(self.browser.text("time").split()[0])
        with open(self.trace, newline="") as file:
            rows = list(csv.DictReader(file))
        row = min(rows, key=lambda r: abs(float(r["time_s"]) - seconds))
        self.assertAlmostEqual(float(row["time_s"]), 0.4, delta=0.005)
        cells = self.browser.value("[...document.querySelectorAll('#joints tbody tr')]"
                                   ".map((tr) => [...tr.cells].map((td) => td.textContent))")
        self.assertEqual([cell[0] for cell in cells], ["leg1", "leg2"])
        for cell in cells:
            for column, name in ((1, "limited_position_rad"), (2, "measured_position_rad"), (5, "measured_torque_nm")):
                digits = 2 if column == 5 else 4
                shown = float(cell[column].replace("\u2212", "-"))
                self.assertAlmostEqual(shown, float(row[f"{cell[0]}_{name}"]), delta=0.51 * 10**-digits)
        self.assertEqual(self.browser.value("document.querySelectorAll('#stage .robot > g').length"), 3)
        self.assertIn("running", self.browser.text("phase"))
        for width in (1200, 400):
            self.browser.resize(width, 900)
            self.assertLessEqual(self.browser.value("document.documentElement.scrollWidth"), width)
            path = os.path.join(os.environ.get("TUMBLER_VIEW_PICTURES", self.folder.name), f"record_{width}.png")
            self.browser.picture(path)
            self.assertGreater(os.path.getsize(path), 10_000)
        self.browser.resize(1200, 900)

    def test_plays_and_stands_still(self):
        self.browser.go(self.view.url + "#t=1")
        self.browser.value("document.getElementById('play').click()")
        self.browser.until("Number(document.getElementById('slider').value) > 1.2")
        self.browser.value("document.getElementById('play').click()")
        before = self.browser.text("time")
        pose = "document.querySelector('#stage .robot').innerHTML"
        drawn = self.browser.value(pose)
        self.browser.value("new Promise((done) => setTimeout(done, 300))")
        self.assertEqual(self.browser.text("time"), before)
        self.browser.value("{ const s = document.getElementById('slider'); s.value = 0.7;"
                           "s.dispatchEvent(new Event('input')); }")
        self.assertNotEqual(self.browser.value(pose), drawn)

    def test_has_no_button_that_ends_a_motion_and_no_path_for_one(self):
        self.browser.go(self.view.url)
        self.assertEqual(self.browser.value("document.getElementById('stop').getBoundingClientRect().width"), 0)
        self.assertGreaterEqual(self.view.ask(self.view.path + "stop", method="POST"), 400)

    def test_refuses_files_that_are_no_records(self):
        for path in (GAIT, self.folder.name, self.folder.name + "/none", "/dev/null"):
            refused = run("tumbler view", path)
            self.assertEqual(refused.returncode, 1, refused.stdout)
            self.assertIn(path, refused.stderr)


class Live(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.browser = Browser()  # one for all, each time with a new page, because it takes long to start

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.drives = os.path.join(self.folder.name, "drives.toml")
        with open(os.path.join(SOURCES, "primitives/robots/tumbler_drives.toml")) as file:
            drives = file.read()
        # Ticks are slow, so that the test does not depend on how well the machine keeps time.
        drives = drives.replace("rate_hz = 1000.0", "rate_hz = 100.0").replace("watchdog_s = 0.025", "watchdog_s = 1.0")
        with open(self.drives, "w") as file:
            file.write(drives)
        # Nor are pauses of the machine faults of the run.
        self.faults = os.path.join(self.folder.name, "faults.toml")
        with open(self.faults, "w") as file:
            file.write('format = "tumbler-faults"\nversion = 1\n[limits]\nlate_ticks_max = 1000\nstale_ticks_max = 1000\n')
        self.others = []

    def tearDown(self):
        self.browser.renew()
        for other in reversed(self.others):
            other.end(signal.SIGKILL)
        self.folder.cleanup()

    def keep(self, other):
        self.others.append(other)
        return other

    def play(self, *more):
        return self.keep(Beside("tumbler run", "sim", GAIT, "--realtime", "--lcm-url", URL, "--attended", "--drives",
                                self.drives, "--faults", self.faults, *more))

    def view(self, *more):
        return self.keep(View("--lcm-url", URL, "--motion", GAIT, *more))

    def page(self, view):
        self.browser.go(view.url)
        return self.browser

    def start(self):
        for _ in range(20):
            if run("tumbler ctl", "start", "--lcm-url", URL).returncode == 0:
                return
        self.fail("tumbler ctl could not start the run")

    def state(self):
        status = json.loads(run("tumbler ctl", "status", "--json", "--lcm-url", URL).stdout)
        with open(os.path.join(SOURCES, "docs/schemas/tumbler-ctl.schema.json")) as schema:
            jsonschema.validate(status, json.load(schema))
        return status["state"]

    def test_shows_a_run_as_it_happens_and_its_button_stops_it(self):
        view = self.view()
        browser = self.page(view)
        browser.until("document.getElementById('notice').textContent.includes('Nothing is heard')")
        self.play()
        browser.until("document.getElementById('phase').textContent.startsWith('disarmed')")
        self.start()
        browser.until("document.getElementById('phase').textContent.startsWith('running')")
        browser.until("document.querySelectorAll('#stage .robot > g').length === 3")
        self.assertIn("simulation", browser.text("place"))
        self.assertIn("bus load", browser.text("run-figures"))
        self.assertIn("leg1", browser.text("joints"))
        browser.until("document.getElementById('events').textContent.includes('running')")
        path = os.path.join(os.environ.get("TUMBLER_VIEW_PICTURES", self.folder.name), "live.png")
        browser.picture(path)
        self.assertGreater(os.path.getsize(path), 10_000)
        browser.value("document.getElementById('stop').click()")
        browser.until("document.getElementById('asked').textContent.includes('taken at tick')")
        browser.until("document.getElementById('phase').textContent.startsWith('holding')")
        self.assertEqual(self.state(), "holding")
        browser.value("document.getElementById('disarm').click()")
        browser.until("document.getElementById('phase').textContent.startsWith('disarmed')")
        self.assertEqual(self.state(), "disarmed")
        self.assertEqual(browser.value("document.getElementById('errors').hidden"), True)

    def test_shows_a_run_without_a_picture_and_says_what_is_missing(self):
        browser = self.page(self.keep(View("--lcm-url", URL)))
        self.play()
        browser.until("document.getElementById('phase').textContent.startsWith('disarmed')")
        browser.until("document.getElementById('joints').textContent.includes('leg2')")
        self.assertIn("--motion", browser.text("no-picture"))
        self.assertEqual(browser.value("document.getElementById('no-picture').hidden"), False)
        self.assertEqual(browser.value("document.querySelectorAll('#stage .robot').length"), 0)
        self.assertEqual(browser.value("document.getElementById('errors').hidden"), True)

    def test_sends_nothing_but_the_two_requests_that_end_a_motion(self):
        view = self.view()
        self.play()
        bus = Multicast()
        number = struct.unpack(">q", bus.wait("TUMBLER_STATE")[24:32])[0]
        for name in ("start", "arm", "play", "clear", "branch", "finish", "command", "STOP", "stop/", "1"):
            for method in ("GET", "POST"):
                self.assertGreaterEqual(view.ask(view.path + name, method=method, body=str(number).encode()), 400, name)
        self.assertEqual(view.ask(view.path + "stop", method="POST", body=b"12"), 409, "another run")
        self.assertEqual(view.ask(view.path + "stop", method="POST"), 409, "no run")
        sent = [name for name, _ in [bus.next() for _ in range(60)]]
        self.assertNotIn("TUMBLER_COMMAND", sent)
        self.assertIn("TUMBLER_STATE", sent)
        for name, code in (("stop", STOP), ("disarm", DISARM)):
            self.assertEqual(view.ask(view.path + name, method="POST", body=str(number).encode()), 202)
            command = bus.wait("TUMBLER_COMMAND")
            self.assertEqual(struct.unpack(">q", command[16:24])[0], number)
            self.assertEqual(command[32], code)
            while bus.next()[0] == "TUMBLER_COMMAND":
                pass
        bus.socket.close()

    def test_serves_no_other_address_and_no_other_page(self):
        view = self.view()
        subprocess.run(["ip", "address", "add", "192.0.2.1/32", "dev", "lo"], check=False)
        with self.assertRaises(urllib.error.URLError):
            view.ask(view.path, address="192.0.2.1")
        self.assertEqual(view.ask(view.path), 200)
        here = f"127.0.0.1:{view.port}"
        self.assertEqual(view.ask("/"), 404)
        self.assertEqual(view.ask("/" + "0" * 32 + "/"), 404)
        for host in ("evil.example", f"evil.example:{view.port}", "127.0.0.1", f"192.0.2.1:{view.port}", ""):
            self.assertEqual(view.ask(view.path, {"Host": host}), 403, host)
        for origin in ("http://evil.example", "null", f"https://{here}", "http://127.0.0.1"):
            for path in ("stop", "disarm"):
                self.assertEqual(view.ask(view.path + path, {"Origin": origin}, "POST"), 403, origin)
        self.assertEqual(view.ask(view.path, {"Host": f"localhost:{view.port}"}), 200)
        self.assertEqual(view.ask(view.path + "stop", {"Origin": f"http://{here}"}, "POST"), 409, "no run is heard")
        told = self.view("--bind", "192.0.2.1")
        self.assertEqual(told.ask(told.path, address="192.0.2.1"), 200)
        self.assertEqual(told.ask(told.path, {"Host": f"evil.example:{told.port}"}, address="192.0.2.1"), 403)

    def test_leaves_the_frames_of_a_run_as_they_are(self):
        frames = []
        for viewed in (False, True):
            view = self.view() if viewed else None
            browser = self.page(view) if viewed else None
            record = os.path.join(self.folder.name, f"{viewed}.rec")
            done = run("tumbler run", "sim", GAIT, "--cycles", "1", "--lcm-url", URL, "--record", record)
            self.assertEqual(done.returncode, 0, done.stderr)
            log = record + ".log"
            self.assertEqual(run("tumbler record", record, "--candump", log).returncode, 0)
            with open(log) as file:
                frames.append(file.read())
            if viewed:
                browser.until("Number(document.getElementById('time').textContent.split(' ')[0]) > 1")
        self.assertGreater(frames[0].count("\n"), 10_000)
        self.assertEqual(frames[0], frames[1])

    def test_says_how_old_the_picture_is_and_picks_up_the_next_run(self):
        view = self.view()
        browser = self.page(view)
        first = self.play()
        browser.until("document.getElementById('phase').textContent.startsWith('disarmed')")
        number = browser.value("run")
        first.end(signal.SIGKILL)
        browser.until("/Nothing received for [0-9.]+ s/.test(document.getElementById('notice').textContent)")
        self.assertEqual(browser.value("document.body.classList.contains('stale')"), True)
        self.play()
        browser.until(f"run !== null && run !== '{number}' && !document.body.classList.contains('stale')")
        self.assertEqual(browser.value("document.getElementById('notice').hidden"), True)

    def test_shows_texts_of_hostile_messages_as_texts_and_takes_no_nonsense(self):
        view = self.view()
        browser = self.page(view)
        bus = Multicast()
        played = self.play()
        state, about = bus.wait("TUMBLER_STATE"), bus.wait("TUMBLER_RUN")
        browser.until("document.getElementById('joints').textContent.includes('leg1')")
        played.end(signal.SIGKILL)
        browser.until("document.body.classList.contains('stale')")
        evil = b"<img src=x onerror=\"document.title='taken'\"></script>\x1b[2J\xff"
        count = struct.unpack(">i", state[self.count_at(state):][:4])[0]
        self.assertEqual(count, 2)
        for channel, good in (("TUMBLER_STATE", state), ("TUMBLER_RUN", about), ("TUMBLER_EVENT", state),
                              ("TUMBLER_TRUTH", about)):
            for size in list(range(0, min(len(good), 300), 7)) + [len(good) - 1]:
                bus.send(channel, good[:size])
            bus.send(channel, good[:8] + b"\xff" * 60_000)
            bus.send(channel, good[:8] + b"\x7f" * (len(good) - 8))
            time.sleep(0.02)
        huge = bytearray(state)
        huge[self.count_at(state):self.count_at(state) + 4] = struct.pack(">i", 10_000_000)
        bus.send("TUMBLER_STATE", bytes(huge))
        browser.until("document.getElementById('notice').textContent.includes('could not be read')")
        joint = (len(state) - self.count_at(state) - 4) // count
        hostile = state[:-joint] + struct.pack(">f", float("nan")) * 14 + state[len(state) - joint + 56:]
        strings = 8 + 16
        names = about[:strings] + text(evil) * 5 + struct.pack(">bbbqdd", 0, 0, 0, 0, float("nan"), float("inf"))
        names += struct.pack(">i", 2) + text(evil) * 4 + struct.pack(">i", 1) + text(evil) + struct.pack(">i", 0)
        names += text(evil) * 4 + about[-(3 * 8 + 10 * 4 + 4 + 4 + 2 * 8):]
        for _ in range(3):
            bus.send("TUMBLER_RUN", names)
            bus.send("TUMBLER_STATE", hostile)
            time.sleep(0.1)
        browser.until("document.getElementById('title').textContent.startsWith('<img')")
        browser.until("document.querySelectorAll('#joints tbody tr')[1].cells[2].textContent === '\u2013'")
        self.assertEqual(browser.value("document.querySelectorAll('img').length"), 0)
        self.assertNotEqual(browser.value("document.title"), "taken")
        self.assertEqual(browser.value("document.getElementById('errors').hidden"), True)
        self.assertLess(view.memory_kb(), 200_000)
        bus.socket.close()

    @staticmethod
    def count_at(state):
        """Where a state_t has the number of its joints: before the joints, whose size is known."""
        joint = 14 * 4 + 4 + 1 + 1 + 8 + 1 + 4 + 4
        return len(state) - 2 * joint - 4

    def test_bounds_its_clients_and_ends_at_once_while_they_listen(self):
        view = self.view()
        request = f"GET {view.path}events HTTP/1.1\r\nHost: 127.0.0.1:{view.port}\r\n\r\n".encode()
        clients = []
        for _ in range(8):
            client = socket.create_connection(("127.0.0.1", view.port), timeout=20)
            client.sendall(request)
            self.assertIn(b" 200 ", client.recv(15) + b" ")
            clients.append(client)
        self.assertEqual(view.ask(view.path + "events"), 503)
        self.assertEqual(view.ask(view.path), 200, "the page and its buttons are still served")
        for _ in range(4):
            clients.append(socket.create_connection(("127.0.0.1", view.port), timeout=20))
        self.assertEqual(view.ask(view.path + "stop", method="POST"), 409)
        before_kb = view.memory_kb()
        with socket.create_connection(("127.0.0.1", view.port), timeout=20) as client:
            with self.assertRaises(OSError):  # Headers without an end are cut off.
                client.sendall(b"GET / HTTP/1.1\r\n")
                for _ in range(20_000):
                    client.sendall(b"X: " + b"a" * 4000 + b"\r\n")
        self.assertLess(view.memory_kb(), before_kb + 20_000)
        status, rest = view.end()
        self.assertEqual(status, 0, rest)
        for client in clients:
            client.close()

    def test_slow_clients_keep_no_request_waiting(self):
        view = self.view()
        for _ in range(5):  # They are cut after two seconds, within which a busy machine may not get through.
            slow = [socket.create_connection(("127.0.0.1", view.port), timeout=20) for _ in range(30)]
            for client in slow:
                client.sendall(b"POST " + view.path.encode() + b"stop HTTP/1.1\r\nHost: ")
            self.assertEqual(view.ask(view.path + "stop", method="POST"), 409, "no run is heard")
            self.assertEqual(view.ask(view.path), 200)
            waiting = 0
            for client in slow:
                client.setblocking(False)
                try:
                    client.recv(1)
                except BlockingIOError:
                    waiting += 1
                except ConnectionResetError:
                    pass
                client.close()
            if waiting == len(slow):
                break
        self.assertEqual(waiting, len(slow), "they were still slow when the others had been answered")

    def test_many_slow_clients_are_cut_and_end_nothing(self):
        view = self.view()
        slow = [socket.create_connection(("127.0.0.1", view.port), timeout=20) for _ in range(300)]
        for _ in range(3):
            self.assertEqual(view.ask(view.path + "disarm", method="POST"), 409)
            self.assertEqual(view.ask(view.path), 200)
        for client in slow[:200]:  # Of one address at most 32 may wait.
            client.settimeout(20)
            try:
                self.assertEqual(client.recv(1), b"")
            except ConnectionResetError:
                pass
        for client in slow:
            client.close()
        self.assertEqual(view.end()[0], 0)

    def test_a_request_to_stop_goes_to_every_run_of_the_robot(self):
        view = self.view()
        self.play()
        bus = Multicast()
        state, about = bus.wait("TUMBLER_STATE"), bus.wait("TUMBLER_RUN")
        number = state[24:32]
        earlier = struct.pack(">q", 12)  # A log of the same robot is played.
        asked = set()
        for _ in range(200):
            bus.send("TUMBLER_RUN", about[:16] + earlier + about[24:])
            bus.send("TUMBLER_STATE", state[:24] + earlier + state[32:])
            if not asked:
                answer = view.ask(view.path + "stop", method="POST", body=str(struct.unpack(">q", number)[0]).encode())
                if answer != 202:
                    answer = view.ask(view.path + "stop", method="POST", body=b"12")
            for _ in range(10):
                name, data = bus.next()
                if name == "TUMBLER_COMMAND":
                    self.assertEqual(data[32], STOP)
                    asked.add(data[16:24])
            if asked == {number, earlier}:
                break
        self.assertEqual(asked, {number, earlier})
        bus.socket.close()

    def test_says_that_the_port_is_taken_or_the_url_cannot_be_used(self):
        view = self.view()
        second = run("tumbler view", "--lcm-url", URL, "--port", str(view.port))
        self.assertEqual(second.returncode, 1)
        self.assertRegex(second.stderr, rf"--port: cannot listen at 127.0.0.1:{view.port}: Address already in use")
        for wrong in (["--lcm-url", "nonsense"], ["--lcm-url", URL, "--bind", "example.org"],
                      ["--lcm-url", URL, "--motion", "none.toml"], ["--port", "0"], ["--lcm-url", URL, "--bind", "8.8.8.8"]):
            self.assertEqual(run("tumbler view", *wrong).returncode, 1, wrong)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2)
