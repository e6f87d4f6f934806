#pragma once

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {

inline const std::string kPrimitives = testing::SourcePath("primitives/");
inline const std::string kHead = "format = \"tumbler-twin\"\nversion = 1\n";

class SimTwin : public ::testing::Test {
 protected:
  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] std::string Write(const std::string& name, const std::string& text) const {
    testing::WriteFile(Path(name), text);
    return Path(name);
  }
  struct Outcome : testing::Outcome {
    Json json;
  };
  /// Runs the gait in virtual time.
  [[nodiscard]] Outcome RunGait(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{"tumbler run", "sim", kPrimitives + "gait.toml", "--json",
                                       Path("run.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }
  [[nodiscard]] Outcome RunTwin(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{"tumbler twin"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }

 private:
  [[nodiscard]] Outcome Run(const std::vector<std::string>& arguments) const {
    std::filesystem::remove(Path("run.json"));
    Outcome outcome{testing::RunProgram(arguments), {}};
    if (std::filesystem::exists(Path("run.json"))) {
      outcome.json = Json::Parse(testing::ReadFile(Path("run.json"))).value();
    }
    return outcome;
  }
  testing::TemporaryFolder folder_;
};

}  // namespace tumbler
