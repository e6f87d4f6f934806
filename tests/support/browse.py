"""Shows pages to a test, one after the other in one browser without a network: browse.py REQUESTS

Each line of the named pipe REQUESTS is a page's path, a fragment, a width in pixels and the path of the file for the
document as the page's scripts left it, with tabs between them. `done` and the number of the request, or why there is
none, is written for each; an empty line ends the browser. With theme=dark in the fragment the browser says that it
prefers dark pages, for those that have no script to read the fragment."""

import os
import sys
import urllib.parse

from page_browser import Browser, Lost, without_network

def start(tries=3):
    """A browser now and then ends or hangs as it starts on a busy machine, which says nothing about our pages."""
    for _ in range(tries - 1):
        try:
            return Browser(prefix=without_network())
        except AssertionError:
            pass
    return Browser(prefix=without_network())


def show(browser, count, page, fragment, width, out):
    browser.resize(int(width), 900)
    theme = "dark" if "theme=dark" in fragment.split("&") else "light"
    browser.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}])
    # With the number no two addresses differ in the fragment alone, which would load nothing.
    browser.go(f"file://{urllib.parse.quote(page)}?{count}" + ("#" + fragment if fragment else ""))
    browser.value("window.probed")
    # What the page does in its next frame belongs to it.
    browser.value("new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
    with open(out, "w", encoding="utf-8") as file:
        file.write(browser.value("document.documentElement.outerHTML"))


# Opened to write, too: it is open before the test opens it, and does not end when the test is between two requests.
with open(os.open(sys.argv[1], os.O_RDWR), encoding="utf-8") as requests:
    browser = start()
    print("ready", flush=True)
    count = 0
    try:
        while request := requests.readline().rstrip("\n"):
            count += 1
            try:
                try:
                    show(browser, count, *request.split("\t"))
                except Lost as error:
                    print("again:", error, flush=True)
                    browser.close()
                    browser = start()
                    show(browser, count, *request.split("\t"))
                print("done", count, flush=True)
            except AssertionError as error:
                print("failed:", error, flush=True)
    finally:
        browser.close()
