#include "common/files/command_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <system_error>
#include <utility>

#include "common/files/build_version.h"
#include "common/files/program.h"

namespace tumbler {
namespace {

/// A range whose text is the one of the help.
CLI::Validator RangeOf(double min, double max) {
  const auto complain = [min, max](std::string& text) {
    double value = 0;
    // NaN is neither below nor above anything.
    const bool within = CLI::detail::lexical_cast(text, value) && value >= min && value <= max;
    return within ? "" : fmt::format("Value {} not in range {} to {}", text, min, max);
  };
  return {complain, fmt::format("{} ... {}", min, max)};
}

/// Refuses what is no finite number, without a word in the help.
CLI::Validator Finite() {
  return {[](std::string& text) {
            double value = 0;
            const bool read = CLI::detail::lexical_cast(text, value);
            return read && !std::isfinite(value) ? fmt::format("Value {} is no finite number", text)
                                                 : "";
          },
          ""};
}
CLI::Validator RangeOf(int min, int max) {
  const auto complain = [range = CLI::Range(min, max)](std::string& text) {
    const std::string complaint = range(text);
    return complaint.empty() ? complaint : complaint + ", of whole numbers";
  };
  return {complain, fmt::format("{} ... {}", min, max)};
}

/// Reads back the text that an option's type and validators make together: `TEXT`,
/// `INT:1 ... 99` or `TEXT:{fifo,deadline}`.
void DescribeValue(const std::string& text, OptionDescription& description) {
  const std::size_t colon = text.find(':');
  description.value = text.substr(0, colon) == "UINT" ? "INT" : text.substr(0, colon);
  if (colon == std::string::npos) return;
  const std::string allowed = text.substr(colon + 1);
  if (!allowed.starts_with('{')) {
    description.range = allowed;
    return;
  }
  for (std::size_t begin = 1; begin < allowed.size();) {
    const std::size_t end = allowed.find_first_of(",}", begin);
    description.choices.push_back(allowed.substr(begin, end - begin));
    begin = end + 1;
  }
}

OptionDescription DescribeOption(const CLI::Option& option) {
  OptionDescription description;
  description.positional = option.get_positional();
  if (description.positional) {
    description.names = {option.get_name(true)};
  } else {
    for (const std::string& name : option.get_snames()) description.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) description.names.push_back("--" + name);
  }
  if (option.get_expected_max() > 0) DescribeValue(option.get_type_name(), description);
  description.default_value = option.get_default_str();
  description.help = option.get_description();
  description.required = option.get_required();
  description.several = option.get_items_expected_max() == CLI::detail::expected_max_vector_size;
  return description;
}

/// What is typed before a command: `tumbler bench BUS `, with what the program takes.
std::string BeforeCommand(const CommandDescription& program) {
  std::string before = program.name + " ";
  for (const OptionDescription& option : program.options)
    if (option.positional) before += option.names.front() + " ";
  return before;
}

CommandDescription DescribeApp(const CLI::App& app, const std::string& before) {
  CommandDescription description;
  description.name = before + app.get_name();
  description.description = app.get_description();
  description.footer = app.get_footer();
  description.options_after_subcommand = app.get_fallthrough();
  for (const CLI::Option* const option : app.get_options())
    description.options.push_back(DescribeOption(*option));
  for (const CLI::App* const sub : app.get_subcommands([](const CLI::App*) { return true; }))
    description.subcommands.push_back(DescribeApp(*sub, BeforeCommand(description)));
  return description;
}

/// An empty value is a variable of a shell that was not set: not zero, and not what holds without
/// the option.
void RejectEmptyValues(CLI::App& app) {
  for (CLI::Option* const option : app.get_options()) {
    if (option->get_expected_max() == 0) continue;  // A flag.
    option->check([](const std::string& value) {
      return value.empty() ? std::string("is empty") : std::string();
    });
  }
  for (CLI::App* const sub : app.get_subcommands([](const CLI::App*) { return true; }))
    RejectEmptyValues(*sub);
}

}  // namespace

CommandLineOption& CommandLineOption::Required() {
  option_->required();
  return *this;
}

CommandLineOption& CommandLineOption::ShowDefault() {
  option_->capture_default_str();
  return *this;
}

CommandLineOption& CommandLineOption::Within(int min, int max) {
  option_->check(RangeOf(min, max));
  return *this;
}

CommandLineOption& CommandLineOption::Within(double min, double max) {
  // Asked first, so that a message about what is no finite number names the range, too.
  option_->transform(RangeOf(min, max));
  return *this;
}

CommandLineOption& CommandLineOption::OneOf(const std::vector<std::string>& names) {
  option_->transform(CLI::IsMember(names, CLI::ignore_case));
  return *this;
}

CommandLineOption& CommandLineOption::LcmUrl() {
  option_->check([](const std::string& value) {
    return value.starts_with("udpm://")
               ? std::string()
               : value +
                     " is no address of LCM's multicast; expected udpm://ADDRESS:PORT?ttl=N, "
                     "such as udpm://239.255.76.67:7667?ttl=0";
  });
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
    : CommandLine(std::make_shared<CLI::App>(description, program)) {
  app_->set_help_flag("-h,--help", "Print this text");
  app_->set_version_flag("--version", fmt::format("{} {}", program, BuildVersion()),
                         "Print version and commit");
}

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
  return CommandLineOption(*app_->add_option(name, value, help)->check(Finite()));
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

CommandLineOption CommandLine::Seed(std::optional<std::uint64_t>& seed, const std::string& help) {
  // It is read as text: as a number, one that is too large would become the largest that fits.
  const auto read = [&seed](const std::string& text) {
    std::int64_t number = 0;
    const char* last = text.data() + text.size();
    const auto [end, error] = std::from_chars(text.data(), last, number);
    if (error != std::errc() || end != last || number < 0) {
      throw UsageError("--seed", fmt::format("is '{}'; allowed: from 0 ... {}", text,
                                             std::numeric_limits<std::int64_t>::max()));
    }
    seed = static_cast<std::uint64_t>(number);
  };
  return Option("--seed", "INT", read, help);
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

void CommandLine::Parse(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "--man-page") == 0)
    throw HelpWanted(ManPage(Describe(), BuildVersion()));
  if (argc == 2 && std::strcmp(argv[1], "--bash-completion") == 0)
    throw HelpWanted(BashCompletion(Describe()));
  RejectEmptyValues(*app_);
  try {
    app_->parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    const std::vector<CLI::App*> subs = app_->get_subcommands();
    throw HelpWanted(
        HelpText(subs.empty() ? Describe() : DescribeApp(*subs.front(), BeforeCommand(Describe())),
                 WidthOfHelp()));
  } catch (const CLI::CallForVersion& version) {
    throw HelpWanted(version.what() + std::string("\n"));
  } catch (const CLI::ParseError& error) {
    throw UsageError(error.what());
  }
}

CommandDescription CommandLine::Describe() const { return DescribeApp(*app_, ""); }

bool CommandLine::Given(const std::string& option) const { return app_->count(option) > 0; }

bool CommandLine::given() const { return app_->parsed(); }

std::string CommandLine::given_subcommand() const {
  return app_->get_subcommands().front()->get_name();
}

}  // namespace tumbler
