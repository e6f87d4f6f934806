#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/files/command_text.h"

namespace CLI {  // NOLINT(readability-identifier-naming): the library's name
class App;
class Option;
}  // namespace CLI

namespace tumbler {

/// Properties of one option or argument beside its name. The help shows them. Each member returns
/// the object again, so that calls can be chained.
class CommandLineOption {
 public:
  CommandLineOption& Required();
  /// Lets the help show the variable's present value as the default.
  CommandLineOption& ShowDefault();
  /// Requires a value in [min, max]. Infinities and NaN are outside.
  CommandLineOption& Within(int min, int max);
  CommandLineOption& Within(double min, double max);
  /// Requires one of these names, in capitals or not. The variable gets the name as it is written
  /// here.
  CommandLineOption& OneOf(const std::vector<std::string>& names);
  /// Requires a URL of LCM's multicast. LCM's other ones are for files, which it would empty.
  CommandLineOption& LcmUrl();
  /// Requires that the other option is given too.
  CommandLineOption& Needs(const CommandLineOption& other);
  /// Requires that the other option is not given.
  CommandLineOption& Excludes(const CommandLineOption& other);
  /// For a list: the option takes this many values each time it is given. The help calls them
  /// `names`, e.g. `X Y Z`.
  CommandLineOption& TakesValues(int count, const std::string& names);
  /// For a list: the option takes one value each time it is given. Without this it takes all values
  /// that follow.
  CommandLineOption& TakesOneValueEachTime();

 private:
  friend class CommandLine;
  explicit CommandLineOption(CLI::Option& option) : option_(&option) {}

  CLI::Option* option_;
};

/// The command line of a program, or of one of its subcommands. All copies stand for the same one.
///
///     CommandLine line("Draws a motion.", "tumbler-draw");
///     line.Option("MOTION", motion, "primitive file (TOML)").Required();
///     line.Option("--width", width_mm, "of the drawing [mm]").Within(10, 1000).ShowDefault();
///     line.Parse(argc, argv);
///
/// A name that begins with dashes is that of an option, any other that of a positional argument.
/// Positional arguments come in the order in which they are declared. A variable keeps its value
/// when nothing is given for it, and has to outlive Parse. Every program has --help and --version,
/// and --man-page and --bash-completion, which print what packages install.
class CommandLine {
 public:
  /// @param program  its name in all texts.
  CommandLine(const std::string& description, const std::string& program);

  CommandLineOption Option(const std::string& name, std::string& value, const std::string& help);
  CommandLineOption Option(const std::string& name, int& value, const std::string& help);
  CommandLineOption Option(const std::string& name, std::size_t& value, const std::string& help);
  CommandLineOption Option(const std::string& name, double& value, const std::string& help);
  CommandLineOption Option(const std::string& name, std::vector<std::string>& values,
                           const std::string& help);
  CommandLineOption Option(const std::string& name, std::vector<double>& values,
                           const std::string& help);
  /// An option whose text the program reads itself. `read` throws UsageError if it cannot.
  /// @param value_name  the name of the value in the help, e.g. `INT`.
  CommandLineOption Option(const std::string& name, const std::string& value_name,
                           const std::function<void(const std::string& text)>& read,
                           const std::string& help);
  /// The option --seed of a random generator, a number from 0 to 2^63 - 1, which any file can hold.
  CommandLineOption Seed(std::optional<std::uint64_t>& seed, const std::string& help);
  /// An option without a value, which makes the variable true.
  CommandLineOption Flag(const std::string& name, bool& value, const std::string& help);

  /// A subcommand, with arguments of its own.
  CommandLine Subcommand(const std::string& name, const std::string& help);
  /// Requires one of the subcommands.
  void RequireSubcommand();
  /// Allows options of this command line behind the subcommand as well.
  void AllowOptionsAfterSubcommand();

  /// Sets the text that the help shows below the options.
  void SetFooter(const std::string& text);

  /// Sets the variables. No argument and no option takes an empty value.
  /// @throws UsageError; HelpWanted (common/files/program.h) when a text is asked for instead.
  void Parse(int argc, char** argv);

  /// What was declared so far.
  [[nodiscard]] CommandDescription Describe() const;

  /// Whether this option was given. After Parse. @pre it was declared.
  [[nodiscard]] bool Given(const std::string& option) const;
  /// Whether this subcommand is the one that was given. After Parse.
  [[nodiscard]] bool given() const;
  /// The name of the subcommand that was given. After Parse. @pre one was given.
  [[nodiscard]] std::string given_subcommand() const;

 private:
  explicit CommandLine(std::shared_ptr<CLI::App> app);

  std::shared_ptr<CLI::App> app_;
};

}  // namespace tumbler
