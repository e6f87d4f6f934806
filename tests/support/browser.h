#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdlib>
#include <string>

#include "tests/support/files.h"

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

/// The document of a page with this fragment in its address, after its scripts and then `probe`
/// have run. Everything that the probe passes to `say` is the text of element `probe`.
/// @param directory  the folder of the page. The test also writes there.
inline std::string BrowsePage(const std::string& page, const std::string& directory,
                              const std::string& fragment, const std::string& probe = "",
                              int width = 1200) {
  if (!probe.empty()) {
    std::string text = ReadFile(page);
    text.insert(text.rfind("</body>"),
                "<pre id=\"probe\"></pre><script>const say = (...words) => "
                "{ byId('probe').textContent += words.join(' ') + '\\n'; };\n" +
                    probe + "</script>");
    WriteFile(page, text);
  }
  const std::string out = directory + "/dom.html";
  const std::string command = "'" + SourcePath("scripts/screenshot") + "' '" + page + "' '" +
                              fragment + "' '" + out + "' " + std::to_string(width) + " 900";
  // NOLINTNEXTLINE(concurrency-mt-unsafe): a test of one thread.
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  std::string dom = ReadFile(out);
  EXPECT_THAT(dom, ::testing::HasSubstr("data-ready=\"true\""))
      << "the page's scripts did not finish";
  return dom;
}

}  // namespace tumbler::testing
