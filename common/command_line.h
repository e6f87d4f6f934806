#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace tumbler {

/// What is to be said of one option or argument beside its name; each member returns it again.
/// The help shows all of it.
class CommandLineOption {
 public:
  CommandLineOption& Required();
  /// The help says which value the variable has now: that without the option.
  CommandLineOption& ShowDefault();
  /// Bounds included. Infinities are outside; NaN is not: it is neither below nor above anything.
  CommandLineOption& Within(int min, int max);
  CommandLineOption& Within(double min, double max);
  /// The value is one of these names, in capitals or not; the variable gets it as it is here.
  CommandLineOption& OneOf(const std::vector<std::string>& names);
  /// Can only be given together with the other.
  CommandLineOption& Needs(const CommandLineOption& other);
  /// Cannot be given together with the other.
  CommandLineOption& Excludes(const CommandLineOption& other);
  /// Of a list: each time the option is given it takes this many values, which the help calls so,
  /// e.g. `X Y Z`.
  CommandLineOption& TakesValues(int count, const std::string& names);
  /// Of a list: the option is given again for each value. Without this it takes all that follow.
  CommandLineOption& TakesOneValueEachTime();

 private:
  friend class CommandLine;
  explicit CommandLineOption(CLI::Option& option) : option_(&option) {}

  CLI::Option* option_;
};

/// The command line of a program, or of a subcommand of it. Copies are the same one.
///
///     CommandLine line("Draws a motion.", "tumbler-draw");
///     line.Option("MOTION", motion, "primitive file (TOML)").Required();
///     line.Option("--width", width_mm, "of the drawing [mm]").Within(10, 1000).ShowDefault();
///     line.Parse(argc, argv);
///
/// A name that begins with dashes is an option's, any other that of a positional argument; these
/// are in the order in which they are declared. Variables keep their values where nothing is given
/// for them, and have to outlive Parse. Every command line has --help.
class CommandLine {
 public:
  /// @param program  the name in the help; where empty, how the program was called.
  explicit CommandLine(const std::string& description, const std::string& program = "");

  CommandLineOption Option(const std::string& name, std::string& value, const std::string& help);
  CommandLineOption Option(const std::string& name, int& value, const std::string& help);
  CommandLineOption Option(const std::string& name, std::size_t& value, const std::string& help);
  CommandLineOption Option(const std::string& name, double& value, const std::string& help);
  CommandLineOption Option(const std::string& name, std::vector<std::string>& values,
                           const std::string& help);
  CommandLineOption Option(const std::string& name, std::vector<double>& values,
                           const std::string& help);
  /// An option whose text the program reads itself. `read` throws UsageError where it cannot.
  /// @param value_name  of the value in the help, e.g. `INT`.
  CommandLineOption Option(const std::string& name, const std::string& value_name,
                           const std::function<void(const std::string& text)>& read,
                           const std::string& help);
  /// An option without a value, which makes the variable true.
  CommandLineOption Flag(const std::string& name, bool& value, const std::string& help);

  /// A subcommand, with arguments of its own.
  CommandLine Subcommand(const std::string& name, const std::string& help);
  /// One of the subcommands has to be there.
  void RequireSubcommand();
  /// Options of this command line may also stand behind the subcommand.
  void AllowOptionsAfterSubcommand();

  /// What the help says below the options.
  void SetFooter(const std::string& text);
  /// No value that is given for what is declared so far may be empty.
  void RejectEmptyValues();

  /// Sets the variables. @throws UsageError, HelpWanted (common/program.h).
  void Parse(int argc, char** argv);

  /// After Parse: whether this subcommand is the one that was given.
  [[nodiscard]] bool given() const;
  /// After Parse: the name of the subcommand that was given. There has to be one.
  [[nodiscard]] std::string given_subcommand() const;

 private:
  explicit CommandLine(std::shared_ptr<CLI::App> app);

  std::shared_ptr<CLI::App> app_;
};

}  // namespace tumbler
