"""A browser without a display, driven through two pipes (Chrome DevTools Protocol)."""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time

CHROMIUM = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            "--disable-dev-shm-usage", "--hide-scrollbars", "--remote-debugging-pipe"]


def without_network():
    """@returns the beginning of a command that runs in a network namespace of its own, which holds nothing but a
    loopback that is down. Others than root need a user namespace, too."""
    return ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--map-root-user", "--net"]


class Refused(AssertionError):
    """The browser did not do what it was told."""


class Lost(AssertionError):
    """The browser ended, or hangs."""


class Browser:
    def __init__(self, width=1200, height=900, prefix=()):
        self.profile = tempfile.mkdtemp()
        read_command, self.commands = os.pipe()
        answers, write_answer = os.pipe()

        def give_pipes():  # The browser reads commands from file 3 and answers in file 4.
            os.dup2(read_command, 23)
            os.dup2(write_answer, 24)
            os.dup2(23, 3)
            os.dup2(24, 4)

        self.process = subprocess.Popen([*prefix, *CHROMIUM, f"--user-data-dir={self.profile}"],
                                        preexec_fn=give_pipes, close_fds=False, stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)
        os.close(read_command)
        os.close(write_answer)
        self.answers = answers
        self.unread = b""
        self.number = 0
        self.session = self.context = None
        try:
            self.renew(width, height)
        except AssertionError:
            self.close()
            raise

    def renew(self, width=1200, height=900):
        """Closes the page. The next one finds nothing of what this one kept, as in a browser that was just started,
        which takes far longer."""
        self.session = None
        if self.context:
            self.send("Target.disposeBrowserContext", browserContextId=self.context)
        self.context = self.send("Target.createBrowserContext")["browserContextId"]
        target = self.send("Target.createTarget", url="about:blank", browserContextId=self.context)["targetId"]
        self.session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.resize(width, height)

    def close(self):
        os.close(self.commands)
        self.process.kill()
        self.process.wait()
        os.close(self.answers)
        shutil.rmtree(self.profile, ignore_errors=True)

    def read(self, patience_s=120):
        while b"\0" not in self.unread:
            if not select.select([self.answers], [], [], patience_s)[0]:
                raise Lost("the browser does not answer")
            part = os.read(self.answers, 1 << 16)
            if not part:
                raise Lost("the browser ended")
            self.unread += part
        answer, _, self.unread = self.unread.partition(b"\0")
        return json.loads(answer)

    def send(self, method, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        try:
            os.write(self.commands, json.dumps(message).encode() + b"\0")
        except BrokenPipeError as error:
            raise Lost("the browser ended") from error
        while True:
            answer = self.read()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise Refused(f"{method}: {answer['error']}")
                return answer["result"]

    def resize(self, width, height):
        self.send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def go(self, url):
        self.send("Page.navigate", url=url)
        self.until("document.readyState === 'complete' && document.documentElement.dataset.ready === 'true'")

    def value(self, expression):
        answer = self.send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def text(self, identifier):
        return self.value(f"document.getElementById('{identifier}').textContent")

    def until(self, expression, patience_s=120):
        """Waits until the expression is true."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            try:
                if self.value(expression):
                    return
            except Refused:  # One page gives way to the next, and takes its scripts' context with it.
                pass
            time.sleep(0.05)
        raise AssertionError(f"never came true: {expression}; the page: {self.value('document.body.innerText')[:1500]}")

    def picture(self, path):
        with open(path, "wb") as file:
            file.write(base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"]))
