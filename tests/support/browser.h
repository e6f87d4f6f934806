#pragma once

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler::testing {

/// The text of the element with this id, up to its first tag. When several elements have the id,
/// their texts are joined.
inline std::string TextOf(const std::string& dom, const std::string& id) {
  const std::size_t at = dom.find("id=\"" + id + "\"");
  if (at == std::string::npos) return "no element " + id;
  const std::size_t from = dom.find('>', at) + 1;
  return dom.substr(from, dom.find('<', from) - from);
}

inline std::size_t Count(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

/// One browser for all pages of a program of tests, because it takes far longer to start than to
/// show a page. Our pages keep nothing in it.
class Browser {
 public:
  static Browser& Instance() {
    static Browser browser;
    return browser;
  }
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  /// Writes the document of a page into a file. @returns whether there is one.
  bool Show(const std::string& page, const std::string& fragment, int width,
            const std::string& out) {
    if (!Ready()) return false;
    const std::size_t before = program_.text().size();
    requests_ << page << '\t' << fragment << '\t' << width << '\t' << out << '\n' << std::flush;
    ++count_;
    if (WaitLongFor("done " + std::to_string(count_) + '\n', before)) return true;
    ADD_FAILURE() << page << " was not shown: " << program_.text();
    stuck_ = true;
    return false;
  }

 private:
  Browser()
      : pipe_(::testing::TempDir() + "tumbler_browser_" + std::to_string(getpid())),
        made_(mkfifo(pipe_.c_str(), 0600) == 0),
        program_({"/usr/bin/python3", "-B", SourcePath("tests/support/browse.py"), pipe_}) {}
  ~Browser() {
    requests_ << '\n' << std::flush;
    if (stuck_) program_.Signal(SIGTERM);
    program_.Wait();
    std::filesystem::remove(pipe_);
  }

  /// @returns whether the browser takes requests; a failure of the test says why it does not.
  bool Ready() {
    if (requests_.is_open()) return true;
    if (made_ && !stuck_ && WaitLongFor("ready\n", 0)) {
      requests_.open(pipe_);
      return true;
    }
    ADD_FAILURE() << "the browser did not start: " << program_.text();
    stuck_ = true;
    return false;
  }
  /// On a busy machine a browser takes longer than other programs are waited for.
  bool WaitLongFor(const std::string& part, std::size_t before) {
    for (int i = 0; i < 10 && program_.text().find("failed:", before) == std::string::npos; ++i) {
      if (program_.WaitFor(part)) return true;
    }
    return false;
  }

  std::string pipe_;
  bool made_;
  Program program_;
  std::ofstream requests_;
  int count_ = 0;
  bool stuck_ = false;
};

/// The document of a page with this fragment in its address, after its scripts and then `probe`
/// have run. Everything that the probe passes to `say` is the text of element `probe`. What it
/// makes of `probed`, a promise, is waited for, unless the browser is one of its own.
/// @param directory  the folder of the page. The test also writes there.
/// @param alone  in a browser of its own, which scripts/screenshot starts.
inline std::string BrowsePage(const std::string& page, const std::string& directory,
                              const std::string& fragment, const std::string& probe = "",
                              int width = 1200, bool alone = false) {
  if (!probe.empty()) {
    std::string text = ReadFile(page);
    text.insert(text.rfind("</body>"),
                "<pre id=\"probe\"></pre><script>const say = (...words) => "
                "{ byId('probe').textContent += words.join(' ') + '\\n'; };\n" +
                    probe + "</script>");
    WriteFile(page, text);
  }
  const std::string out = directory + "/dom.html";
  if (alone) {
    const std::string command = "'" + SourcePath("scripts/screenshot") + "' '" + page + "' '" +
                                fragment + "' '" + out + "' " + std::to_string(width) + " 900";
    // NOLINTNEXTLINE(concurrency-mt-unsafe): a test of one thread.
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
  } else if (!Browser::Instance().Show(page, fragment, width, out)) {
    return "";
  }
  std::string dom = ReadFile(out);
  EXPECT_THAT(dom, ::testing::HasSubstr("data-ready=\"true\""))
      << "the page's scripts did not finish";
  return dom;
}

}  // namespace tumbler::testing
