// tumbler identify: from a robot's records to its model.

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "offline/studies/excitation.h"
#include "offline/studies/recorded_motion.h"
#include "offline/studies/robot_fit.h"

namespace tumbler {
namespace {

struct Arguments {
  std::string task, out;
  std::vector<std::string> records;
  double weight_kg = 0;
};

ExitStatus Excite(const Arguments& arguments) {
  ExcitationSettings settings;
  settings.interrupt = &EndOnSignals();
  settings.say = [](const std::string& text) { fmt::print(stderr, "{}\n", text); };
  CheckWritable(arguments.out);
  const Excitation found = MakeExcitation(arguments.task, settings);
  if (!found.file) {
    fmt::print(stderr, "no motion was found: {}\nno file was written\n", found.cause);
    return ExitStatus::kRefused;
  }
  PendingFile(arguments.out, ToToml(*found.file)).Commit();
  fmt::print("{} safe of {}, information {:.4g}, torque {:.3g} N m, pitch {:.3g} rad\n", found.safe,
             found.tried, found.information, found.torque_nm, found.pitch_rad);
  return ExitStatus::kDone;
}

ExitStatus Fit(const Arguments& arguments) {
  std::vector<RecordedMotion> records;
  for (const std::string& path : arguments.records) {
    records.push_back(ReadRecordedMotion(path));
    const RecordedMotion& record = records.back();
    fmt::print("{}: {} ticks, late {:.3g} s (sd {:.2g}), arrivals", path, record.ticks.size(),
               record.late_s, record.late_sd_s);
    for (const auto& joint : record.joints) fmt::print(" {:.4g}", joint.arrival_s);
    fmt::print("\n");
    for (const std::string& remark : record.remarks) fmt::print("  {}\n", remark);
  }
  FitSettings settings;
  settings.weight_kg = arguments.weight_kg;
  settings.say = [](const std::string& text) { fmt::print(stderr, "{}\n", text); };
  const FitOutcome fit =
      FitRobot(records, PriorOfRecords(records, arguments.weight_kg > 0), settings);
  fmt::print("chi {:.3g}{}, {} evaluations\n", fit.chi, fit.effective ? " (effective)" : "",
             fit.evaluations);
  for (std::size_t i = 0; i < fit.posterior.size(); ++i) {
    fmt::print("  {:34} {:11.5g} sd {:.2g}  share {:.3f}{}\n", NameOf(fit.posterior.quantities[i]),
               fit.posterior.ValueOf(i), fit.posterior.DeviationOf(i), fit.ShareLeft(i),
               fit.Identifiable(i) ? "" : "  not identifiable");
  }
  return ExitStatus::kDone;
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line("Finds a robot's model from its records.", "tumbler identify");
  line.RequireSubcommand();
  CommandLine excite = line.Subcommand("excite", "Makes a motion that tells about a robot");
  excite.Option("TASK", arguments.task, "Task file (TOML) that begins in the pose").Required();
  excite.Option("--out", arguments.out, "Write the primitive here").Required();
  CommandLine fit = line.Subcommand("fit", "Finds the robot that explains records");
  fit.Option("RECORD", arguments.records, "Flight records of one robot").Required();
  fit.Option("--weight-kg", arguments.weight_kg, "Its mass, as weighed").Within(1e-3, 1e4);
  line.Parse(argc, argv);
  return line.given_subcommand() == "excite" ? Excite(arguments) : Fit(arguments);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::RunProgram("error", argc, argv, tumbler::Main); }
