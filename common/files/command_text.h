#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace tumbler {

/// What a command line says of one option or positional argument.
struct OptionDescription {
  std::vector<std::string> names;    ///< `--help` and `-h`, or the one of a positional argument.
  std::string value;                 ///< What it takes, such as INT; empty for a flag.
  std::string range;                 ///< Allowed values, such as `1 ... 99`; empty: not bounded.
  std::vector<std::string> choices;  ///< Allowed names; empty: any.
  std::string default_value;         ///< Empty: not told.
  std::string help;
  bool positional = false;
  bool required = false;
  bool several = false;  ///< Whether it may be given more than once.
};

/// What a program says of itself. Help, manual page and completion are made of it.
struct CommandDescription {
  std::string name;         ///< Such as `tumbler run`; of a subcommand behind the program's.
  std::string description;  ///< Its first sentence stands alone in lists.
  /// Text below the options. Here and in the description, ends of lines mean nothing within a
  /// paragraph; an empty line ends one, and so does a list, whose entries are indented lines
  /// `  NAME   words` that go on in lines indented as far as the words.
  std::string footer;
  std::vector<OptionDescription> options;
  std::vector<CommandDescription> subcommands;
  bool options_after_subcommand = false;  ///< Whether subcommands take its options as well.
};

/// The first sentence of a text, without its full stop.
[[nodiscard]] std::string FirstSentence(const std::string& text);

/// How wide help is where nothing says otherwise [characters].
inline constexpr std::size_t kHelpWidth = 100;

/// The text for --help, in lines of up to `width` characters.
[[nodiscard]] std::string HelpText(const CommandDescription& command,
                                   std::size_t width = kHelpWidth);

/// A manual page of section 1, for `man`.
/// @param version  for the page's foot, such as `0.1.0`.
[[nodiscard]] std::string ManPage(const CommandDescription& command, const std::string& version);

/// A script that tells bash how the arguments are completed: subcommands, options, names among
/// which is chosen, and files otherwise. For a name of several words, such as `tumbler run`, it
/// only has the function, `_tumbler_run`, which the completion of the first word calls.
[[nodiscard]] std::string BashCompletion(const CommandDescription& command);

}  // namespace tumbler
