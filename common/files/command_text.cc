#include "common/files/command_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace tumbler {
namespace {

constexpr std::size_t kHelpColumn = 28;  // where the explanation of an option begins

/// The name of a command in its usage: with what it takes.
std::string Usage(const CommandDescription& command) {
  std::string usage = command.name;
  if (std::ranges::any_of(command.options, [](const auto& o) { return !o.positional; }))
    usage += " [OPTIONS]";
  for (const OptionDescription& option : command.options) {
    if (!option.positional) continue;
    const std::string name = option.names.front() + (option.several ? "..." : "");
    usage += option.required ? ' ' + name : fmt::format(" [{}]", name);
  }
  if (!command.subcommands.empty()) usage += " COMMAND ...";
  return usage;
}

/// Everything that is allowed, and what holds without the option, in one bracket.
std::string Allowed(const OptionDescription& option) {
  std::vector<std::string> parts;
  if (option.required && !option.positional) parts.emplace_back("required");
  if (!option.range.empty()) parts.push_back(option.range);
  if (!option.choices.empty()) parts.push_back(fmt::format("{}", fmt::join(option.choices, ", ")));
  if (!option.default_value.empty()) parts.push_back("default " + option.default_value);
  return parts.empty() ? "" : fmt::format(" [{}]", fmt::join(parts, "; "));
}

/// The words of a text in lines of at most `width`.
std::vector<std::string> Wrapped(const std::string& text, std::size_t width) {
  std::vector<std::string> lines;
  std::string line;
  const auto add = [&](std::string_view word) {
    if (!line.empty() && line.size() + 1 + word.size() > width) {
      lines.push_back(line);
      line.clear();
    }
    if (!line.empty()) line += ' ';
    line += word;
  };
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find_first_of(" \n", begin), text.size());
    if (end > begin) add(std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
  }
  lines.push_back(line);
  return lines;
}

/// A paragraph of a text, or an entry of a list in it: a name, and what stands beside it.
struct Block {
  std::string name;        ///< Of an entry, with the spaces around it; empty: a paragraph.
  std::string words;       ///< Without ends of lines.
  bool after_gap = false;  ///< Whether an empty line stands before it.
};

/// The blocks of a text. Lines that are not indented are a paragraph up to the next empty line, and
/// may be broken anywhere. An indented line `  NAME   words` is an entry. Lines that are indented
/// as far as its words go on with them.
std::vector<Block> BlocksOf(const std::string& text) {
  std::vector<Block> blocks;
  bool gap = false, list = false;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    const std::size_t indent = line.find_first_not_of(' ');
    if (indent == std::string::npos) {
      gap = true;
      continue;
    }
    const bool goes_on = !blocks.empty() && !gap && (indent > 0) == list &&
                         (indent == 0 || indent >= blocks.back().name.size());
    list = indent > 0;
    if (goes_on) {
      blocks.back().words += ' ' + line.substr(indent);
    } else {
      Block block{"", line, gap && !blocks.empty()};
      if (list) {
        const std::size_t name_end = std::min(line.find("  ", indent), line.size());
        const std::size_t words = std::min(line.find_first_not_of(' ', name_end), line.size());
        block.name = line.substr(0, words);
        block.words = line.substr(words);
      }
      blocks.push_back(block);
    }
    gap = false;
  }
  return blocks;
}

/// A text whose lines are as wide as the help is, wherever those of the source end.
std::string Paragraphs(const std::string& text, std::size_t width) {
  std::string out;
  for (const Block& block : BlocksOf(text)) {
    if (block.after_gap) out += '\n';
    std::string before = block.name;
    for (const std::string& line : Wrapped(block.words, width - block.name.size())) {
      out += before + line + '\n';
      before.assign(block.name.size(), ' ');
    }
  }
  return out;
}

/// An entry of a list in the help: a name, and its explanation in a column of its own.
std::string Entry(const std::string& name, const std::string& help, std::size_t width) {
  std::string text = "  " + name;
  std::string indent = text.size() + 2 > kHelpColumn ? '\n' + std::string(kHelpColumn, ' ')
                                                     : std::string(kHelpColumn - text.size(), ' ');
  for (const std::string& line : Wrapped(help, width - kHelpColumn)) {
    text += indent + line;
    indent = '\n' + std::string(kHelpColumn, ' ');
  }
  return text + '\n';
}

std::string NameInHelp(const OptionDescription& option) {
  std::string name = fmt::format("{}", fmt::join(option.names, ", "));
  if (!option.positional && !option.value.empty()) name += ' ' + option.value;
  return option.several ? name + " ..." : name;
}

std::string Options(const CommandDescription& command, bool positional, std::size_t width) {
  std::string text;
  for (const OptionDescription& option : command.options) {
    if (option.positional == positional)
      text += Entry(NameInHelp(option), option.help + Allowed(option), width);
  }
  return text;
}

std::string_view Trimmed(std::string_view text) {
  const std::size_t begin = std::min(text.find_first_not_of(' '), text.size());
  return text.substr(begin, text.find_last_not_of(' ') + 1 - begin);
}

/// Text that troff takes as it is.
std::string Troff(std::string_view text) {
  std::string out;
  bool line_begins = true;
  for (const char c : text) {
    if (line_begins && (c == '.' || c == '\'')) out += "\\&";
    line_begins = c == '\n';
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else if (c == '`') {
      out += "\\(ga";
    } else if (c == '\'') {
      out += "\\(aq";
    } else if (c == '^') {
      out += "\\(ha";
    } else if (c == '~') {
      out += "\\(ti";
    } else {
      out += c;
    }
  }
  return out;
}

/// Paragraphs and lists, whose lines troff breaks.
std::string TroffParagraphs(const std::string& text) {
  std::string out;
  for (const Block& block : BlocksOf(text)) {
    out += block.name.empty() ? ".PP\n" : fmt::format(".TP\n{}\n", Troff(Trimmed(block.name)));
    out += Troff(block.words) + '\n';
  }
  return out;
}

std::string TroffOptions(const CommandDescription& command) {
  std::string text;
  for (const OptionDescription& option : command.options) {
    std::string names;
    for (const std::string& name : option.names)
      names += fmt::format("{}\\fB{}\\fR", names.empty() ? "" : ", ", Troff(name));
    if (!option.positional && !option.value.empty())
      names += fmt::format(" \\fI{}\\fR", Troff(option.value));
    text += fmt::format(".TP\n{}{}\n{}\n", names, option.several ? " ..." : "",
                        Troff(option.help + Allowed(option)));
  }
  return text;
}

/// The names after which bash offers what `offers` says, as a case of the shell.
std::string CaseOf(const OptionDescription& option) {
  std::string offer;
  if (!option.choices.empty()) {
    offer =
        fmt::format("COMPREPLY=($(compgen -W '{}' -- \"$cur\"))", fmt::join(option.choices, " "));
  } else if (option.value == "INT" || option.value == "FLOAT") {
    offer = "compopt +o default";
  } else {
    offer = ":";
  }
  return fmt::format("    {}) {}; return ;;\n", fmt::join(option.names, "|"), offer);
}

std::string OptionNames(const CommandDescription& command) {
  std::string names;
  for (const OptionDescription& option : command.options) {
    if (option.positional) continue;
    for (const std::string& name : option.names) names += (names.empty() ? "" : " ") + name;
  }
  return names;
}

}  // namespace

std::string FirstSentence(const std::string& text) {
  const std::size_t end =
      std::min({text.find(". "), text.find(".\n"), text.find(": "), text.find("\n\n")});
  std::string sentence = text.substr(0, end);
  if (sentence.ends_with('.')) sentence.pop_back();
  std::ranges::replace(sentence, '\n', ' ');
  return sentence;
}

std::string HelpText(const CommandDescription& command, std::size_t width) {
  std::string text =
      fmt::format("{}\nUsage: {}\n", Paragraphs(command.description, width), Usage(command));
  if (const std::string list = Options(command, true, width); !list.empty()) text += "\n" + list;
  if (const std::string list = Options(command, false, width); !list.empty())
    text += "\nOptions:\n" + list;
  if (!command.subcommands.empty()) {
    text += "\nCommands:\n";
    for (const CommandDescription& sub : command.subcommands) {
      text +=
          Entry(sub.name.substr(sub.name.rfind(' ') + 1), FirstSentence(sub.description), width);
    }
    // With what comes before a command.
    const std::string& first = command.subcommands.front().name;
    text += fmt::format("\n`{} COMMAND --help` tells more of each.\n",
                        first.substr(0, first.rfind(' ')));
  }
  if (!command.footer.empty()) text += '\n' + Paragraphs(command.footer, width);
  return text;
}

std::string ManPage(const CommandDescription& command, const std::string& version) {
  // A page has one word for its name: `man tumbler run` shows that of `tumbler run`.
  std::string page = command.name;
  std::ranges::replace(page, ' ', '-');
  std::string title = page;
  std::ranges::transform(title, title.begin(), [](char c) {
    return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  });
  std::string text = fmt::format(
      ".TH {} 1 \"\" \"Tumbler {}\" \"User Commands\"\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n.B {}\n"
      ".SH DESCRIPTION\n{}",
      Troff(title), Troff(version), Troff(page), Troff(FirstSentence(command.description)),
      Troff(Usage(command)), TroffParagraphs(command.description));
  text += ".SH OPTIONS\n" + TroffOptions(command);
  if (!command.subcommands.empty()) text += ".SH COMMANDS\n";
  for (const CommandDescription& sub : command.subcommands) {
    text += fmt::format(".SS {}\n{}{}", Troff(Usage(sub)), TroffParagraphs(sub.description),
                        TroffOptions(sub));
  }
  if (!command.footer.empty()) text += ".SH NOTES\n" + TroffParagraphs(command.footer);
  return text;
}

std::string BashCompletion(const CommandDescription& command) {
  std::string function = "_" + command.name;
  for (const char separator : {'-', ' '}) std::ranges::replace(function, separator, '_');
  // The words of the name are the first ones of the line.
  const auto words = 1 + std::ranges::count(command.name, ' ');
  std::string text = fmt::format(
      "# Completion of {0} for bash, made from the program's own options.\n{1}() {{\n"
      "  local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD-1]}} word sub=\n"
      "  COMPREPLY=()\n"
      "  if [[ $cur == = ]]; then cur=; elif [[ $prev == = ]]; then "
      "prev=${{COMP_WORDS[COMP_CWORD-2]}}; fi\n",
      command.name, function);
  std::string names;
  for (const CommandDescription& sub : command.subcommands)
    names += (names.empty() ? "" : " ") + sub.name.substr(sub.name.rfind(' ') + 1);
  std::string known = names;
  std::ranges::replace(known, ' ', '|');
  if (!names.empty()) {
    text += fmt::format(
        "  for word in \"${{COMP_WORDS[@]:{0}:COMP_CWORD-{0}}}\"; do\n"
        "    case $word in {1}) sub=$word; break ;; esac\n  done\n",
        words, known);
  }
  text += "  case $prev in\n";
  std::vector<const CommandDescription*> all = {&command};
  for (const CommandDescription& sub : command.subcommands) all.push_back(&sub);
  std::vector<std::string> told;
  for (const CommandDescription* one : all) {
    for (const OptionDescription& option : one->options) {
      const bool again = std::ranges::find(told, option.names.front()) != told.end();
      if (option.positional || option.value.empty() || again) continue;
      told.push_back(option.names.front());
      text += CaseOf(option);
    }
  }
  text += "  esac\n  local options=\n  case $sub in\n";
  for (const CommandDescription& sub : command.subcommands) {
    text += fmt::format("    {}) options='{}{}' ;;\n", sub.name.substr(sub.name.rfind(' ') + 1),
                        OptionNames(sub),
                        command.options_after_subcommand ? ' ' + OptionNames(command) : "");
  }
  text += fmt::format("    *) options='{}' ;;\n  esac\n", OptionNames(command));
  text += "  if [[ $cur == -* ]]; then\n    COMPREPLY=($(compgen -W \"$options\" -- \"$cur\"))\n";
  if (!names.empty()) {
    text += fmt::format(
        "  elif [[ -z $sub ]]; then\n    COMPREPLY=($(compgen -W '{}' -- \"$cur\"))\n", names);
  }
  text += "  fi\n}\n";
  // A name of several words is completed by the completion of its first, which calls this function.
  if (words == 1) text += fmt::format("complete -o default -F {} {}\n", function, command.name);
  return text;
}

}  // namespace tumbler
