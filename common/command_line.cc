#include "common/command_line.h"

#include <CLI/CLI.hpp>
#include <utility>

#include "common/program.h"

namespace tumbler {

CommandLineOption& CommandLineOption::Required() {
  option_->required();
  return *this;
}

CommandLineOption& CommandLineOption::ShowDefault() {
  option_->capture_default_str();
  return *this;
}

CommandLineOption& CommandLineOption::Within(int min, int max) {
  option_->check(CLI::Range(min, max));
  return *this;
}

CommandLineOption& CommandLineOption::Within(double min, double max) {
  option_->check(CLI::Range(min, max));
  return *this;
}

CommandLineOption& CommandLineOption::OneOf(const std::vector<std::string>& names) {
  option_->transform(CLI::IsMember(names, CLI::ignore_case));
  return *this;
}

CommandLineOption& CommandLineOption::Needs(const CommandLineOption& other) {
  option_->needs(other.option_);
  return *this;
}

CommandLineOption& CommandLineOption::Excludes(const CommandLineOption& other) {
  option_->excludes(other.option_);
  return *this;
}

CommandLineOption& CommandLineOption::TakesValues(int count, const std::string& names) {
  option_->expected(count)->allow_extra_args(false)->type_name(names);
  return *this;
}

CommandLineOption& CommandLineOption::TakesOneValueEachTime() {
  option_->allow_extra_args(false);
  return *this;
}

CommandLine::CommandLine(const std::string& description, const std::string& program)
    : CommandLine(std::make_shared<CLI::App>(description, program)) {}

CommandLine::CommandLine(std::shared_ptr<CLI::App> app) : app_(std::move(app)) {}

CommandLineOption CommandLine::Option(const std::string& name, std::string& value,
                                      const std::string& help) {
  return CommandLineOption(*app_->add_option(name, value, help));
}

CommandLineOption CommandLine::Option(const std::string& name, int& value,
                                      const std::string& help) {
  return CommandLineOption(*app_->add_option(name, value, help));
}

CommandLineOption CommandLine::Option(const std::string& name, std::size_t& value,
                                      const std::string& help) {
  return CommandLineOption(*app_->add_option(name, value, help));
}

CommandLineOption CommandLine::Option(const std::string& name, double& value,
                                      const std::string& help) {
  return CommandLineOption(*app_->add_option(name, value, help));
}

CommandLineOption CommandLine::Option(const std::string& name, std::vector<std::string>& values,
                                      const std::string& help) {
  return CommandLineOption(*app_->add_option(name, values, help));
}

CommandLineOption CommandLine::Option(const std::string& name, std::vector<double>& values,
                                      const std::string& help) {
  return CommandLineOption(*app_->add_option(name, values, help));
}

CommandLineOption CommandLine::Option(const std::string& name, const std::string& value_name,
                                      const std::function<void(const std::string& text)>& read,
                                      const std::string& help) {
  CLI::Option* const option = app_->add_option_function<std::string>(name, read, help);
  return CommandLineOption(*option->type_name(value_name));
}

CommandLineOption CommandLine::Flag(const std::string& name, bool& value, const std::string& help) {
  return CommandLineOption(*app_->add_flag(name, value, help));
}

CommandLine CommandLine::Subcommand(const std::string& name, const std::string& help) {
  // The shared pointer keeps the whole command line alive as long as its subcommand.
  return CommandLine(std::shared_ptr<CLI::App>(app_, app_->add_subcommand(name, help)));
}

void CommandLine::RequireSubcommand() { app_->require_subcommand(1); }

void CommandLine::AllowOptionsAfterSubcommand() { app_->fallthrough(); }

void CommandLine::SetFooter(const std::string& text) { app_->footer(text); }

void CommandLine::RejectEmptyValues() {
  for (CLI::Option* option : app_->get_options()) {
    if (option->get_expected_max() == 0) continue;  // A flag.
    option->check([](const std::string& value) {
      return value.empty() ? std::string("is empty") : std::string();
    });
  }
}

void CommandLine::Parse(int argc, char** argv) {
  try {
    app_->parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    throw HelpWanted(app_->help());
  } catch (const CLI::ParseError& error) {
    throw UsageError(error.what());
  }
}

bool CommandLine::given() const { return app_->parsed(); }

std::string CommandLine::given_subcommand() const {
  return app_->get_subcommands().front()->get_name();
}

}  // namespace tumbler
