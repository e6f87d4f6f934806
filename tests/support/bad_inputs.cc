#include "tests/support/bad_inputs.h"

#include <sstream>
#include <stdexcept>

#include "tests/support/files.h"

namespace tumbler::testing {
namespace {

const std::string kFolder = "tests/data/bad_inputs/";

/// A line of an edit: its sign, and the text after the sign.
struct EditLine {
  char sign;
  std::string text;
};

/// The text with `\n` and `\xHH` replaced by the bytes that they stand for.
std::string Unescaped(const std::string& text) {
  std::string bytes;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\\' && text[i + 1] == 'n') {
      bytes += '\n';
      i += 1;
    } else if (text[i] == '\\' && text[i + 1] == 'x') {
      bytes += static_cast<char>(std::stoi(text.substr(i + 2, 2), nullptr, 16));
      i += 3;
    } else {
      bytes += text[i];
    }
  }
  return bytes;
}

/// Makes edits in a text from top to bottom.
class Editor {
 public:
  Editor(std::string text, const std::vector<EditLine>& lines)
      : text_(std::move(text)), lines_(lines) {}

  std::string Edited() {
    while (next_ < lines_.size()) {
      const std::size_t before = next_;
      Edit();
      if (next_ == before) throw std::runtime_error("not an edit: " + lines_[next_].text);
    }
    return text_;
  }

 private:
  /// Takes the next lines of one sign, joined.
  std::string Take(char sign) {
    std::string joined;
    for (bool first = true; Is(sign); first = false) {
      joined += (first ? "" : "\n") + Unescaped(lines_[next_++].text);
    }
    return joined;
  }
  std::string TakeNewText() {
    std::string text = Take('+');
    for (; Is('*'); ++next_) {
      std::size_t digits = 0;
      const int count = std::stoi(lines_[next_].text, &digits);
      const std::string unit = Unescaped(lines_[next_].text.substr(digits + 1));
      for (int i = 0; i < count; ++i) text += ReplacedAll(unit, "#", std::to_string(i));
    }
    return text;
  }
  [[nodiscard]] bool Is(char sign) const {
    return next_ < lines_.size() && lines_[next_].sign == sign;
  }
  [[nodiscard]] std::size_t EndOf(const std::string& part, std::size_t from) const {
    const std::size_t at = text_.find(part, from);
    if (at == std::string::npos) throw std::runtime_error("the good file lacks '" + part + "'");
    return at + part.size();
  }

  void Edit() {
    const bool below = Is('@');
    while (Is('@')) at_ = EndOf(Unescaped(lines_[next_++].text), at_);
    if (Is('-')) {
      const std::string old = Take('-');
      std::size_t end = EndOf(old, at_);
      const std::size_t begin = end - old.size();
      if (Is('>')) {
        const std::string last = Unescaped(lines_[next_++].text);
        end = last.empty() ? text_.size() : EndOf(last, end);
      }
      const bool replaces = Is('+') || Is('*');
      if (!replaces && text_[end] == '\n') ++end;  // The whole line goes.
      Put(begin, end, TakeNewText());
    } else if (Is('+') || Is('*')) {
      const std::size_t line = below ? EndOf("\n", at_) : 0;
      Put(line, line, TakeNewText() + "\n");
    }
  }
  void Put(std::size_t begin, std::size_t end, const std::string& text) {
    text_.replace(begin, end - begin, text);
    at_ = begin + text.size();
  }

  std::string text_;
  const std::vector<EditLine>& lines_;
  std::size_t next_ = 0;
  std::size_t at_ = 0;
};

}  // namespace

std::string GoodTask() { return ReadFile(SourcePath(kFolder + "good.toml")); }
std::string GoodRobot() { return ReadFile(SourcePath(kFolder + "good.urdf")); }

std::vector<BadInput> BadInputs() {
  const std::string task = GoodTask(), robot = GoodRobot();
  std::vector<BadInput> inputs;
  std::vector<EditLine> edits;
  std::istringstream lines(ReadFile(SourcePath(kFolder + "mistakes.txt")));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("#")) continue;
    if (!line.starts_with("    ")) {
      inputs.push_back({line, "", ""});
      edits.clear();
      continue;
    }
    BadInput& input = inputs.back();
    const EditLine edit{line[4], line.size() > 6 ? line.substr(6) : ""};
    if (edit.sign != ':') {
      edits.push_back(edit);
      continue;
    }
    input.message = edit.text;
    try {
      input.text = Editor(input.is_task() ? task : robot, edits).Edited();
    } catch (const std::exception& error) {
      throw std::runtime_error("mistakes.txt: " + input.name + ": " + error.what());
    }
  }
  return inputs;
}

void WriteBadInputs(const std::filesystem::path& folder) {
  WriteFile(folder / "good.toml", GoodTask());
  WriteFile(folder / "good.urdf", GoodRobot());
  for (const BadInput& input : BadInputs()) WriteFile(folder / input.name, input.text);
}

}  // namespace tumbler::testing
