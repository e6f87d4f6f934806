// Motions on simulated robots in Python: one run, and many robots that are not the model.

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/files/program.h"
#include "common/files/share.h"
#include "common/files/temporary_folder.h"
#include "offline/python/arrays.h"
#include "offline/python/bindings.h"
#include "offline/python/define.h"
#include "offline/python/file_error_parts.h"
#include "offline/python/interruptible.h"
#include "offline/python/loaded_record.h"
#include "offline/python/motion_path.h"
#include "offline/python/record_object.h"
#include "offline/python/simulated_run.h"
#include "offline/studies/space_study.h"
#include "offline/studies/spread_names.h"
#include "offline/studies/study.h"

namespace tumbler {
namespace {

namespace py = pybind11;
using FilePath = std::optional<std::filesystem::path>;

std::string NameOf(const FilePath& path) { return path ? path->string() : std::string(); }

/// @throws py::value_error  naming the argument.
template <typename Number>
void CheckWithin(const char* name, Number value, Number least, Number most) {
  if (value >= least && value <= most) return;
  throw py::value_error(
      fmt::format("{}: is {}; allowed: from {} ... {}", name, value, least, most));
}

/// A simulated run with its flight record.
struct SimulatedRun {
  py::object record;  ///< A tumbler.Record.
  std::string outcome;
  std::string reason;
  std::optional<bool> as_asked;
  std::string json;
};

SimulatedRun Simulate(const py::object& motion, SimulatedRunPlan plan) {
  CheckWithin("cycles", plan.settings.cycles, 0, 100000);
  CheckWithin("get_ups", plan.settings.get_ups, 0, 1000);
  CheckWithin("speed", plan.settings.speed, 0.1, 1.0);
  CheckWithin("hold_s", plan.settings.hold_s, 0.0, 3600.0);
  const MotionPath path(motion);
  plan.motion = path.path();
  const TemporaryFolder folder;
  if (plan.record.empty()) plan.record = (folder.path() / "run.rec").string();
  std::shared_ptr<LoadedRecord> record;
  SimulatedRun run = Interruptibly([&](std::atomic<bool>& stop) {
    return Reading(plan.motion, [&](const std::string& /*path*/) {
      const RunSummary summary = SimulateRun(plan, stop);
      SimulatedRun done;
      record = std::make_shared<LoadedRecord>(LoadRecord(plan.record));
      done.outcome = ToString(summary.outcome);
      done.reason = summary.reason;
      done.as_asked = AsAsked(summary);
      done.json = ToJson(summary);
      return done;
    });
  });
  run.record = RecordObject(record);
  return run;
}

void BindSimulate(py::module_& module) {
  py::class_<SimulatedRun>(module, "Run",
                           "A run on the simulated robot. Runs are equal when their outcomes and\n"
                           "records are.")
      .def_readonly("record", &SimulatedRun::record, "Every tick of it, with the truth.")
      .def_readonly("outcome", &SimulatedRun::outcome,
                    "'completed', or how it ended otherwise: 'fault', 'refused'.")
      .def_readonly("reason", &SimulatedRun::reason, "Of a fault or a refusal; else empty.")
      .def_readonly("as_asked", &SimulatedRun::as_asked,
                    "Whether it was completed, and the robot did what the motions are for; None\n"
                    "where that was not judged: the run ended before, or they are for nothing.")
      .def_property_readonly(
          "summary",
          [](const SimulatedRun& self) {
            return py::module_::import("json").attr("loads")(self.json);
          },
          "The figures that `tumbler run sim --json` writes.")
      .def(
          "__eq__",
          [](const SimulatedRun& a, const SimulatedRun& b) {
            return a.outcome == b.outcome && a.reason == b.reason && a.as_asked == b.as_asked &&
                   a.record.equal(b.record);
          },
          py::is_operator())
      .def(py::pickle(
          [](const SimulatedRun& self) {
            return py::make_tuple(self.record, self.outcome, self.reason, self.as_asked, self.json);
          },
          [](const py::tuple& state) {
            return SimulatedRun{state[0], state[1].cast<std::string>(),
                                state[2].cast<std::string>(), state[3].cast<std::optional<bool>>(),
                                state[4].cast<std::string>()};
          }))
      .def("__repr__",
           [](const SimulatedRun& self) { return "<tumbler.Run " + self.outcome + ">"; });
  DefineFunction(
      module, "simulate",
      [](const py::object& motion, int cycles, const std::string& branch,
         const std::string& from_node, int get_ups, double speed, double hold_s,
         const FilePath& twin, const FilePath& drives, const FilePath& faults,
         const FilePath& bus_faults, const FilePath& record) {
        SimulatedRunPlan plan;
        plan.from_node = from_node;
        plan.drives = NameOf(drives);
        plan.twin = NameOf(twin);
        plan.faults = NameOf(faults);
        plan.bus_faults = NameOf(bus_faults);
        plan.branch = branch;
        plan.record = NameOf(record);
        plan.settings.cycles = cycles;
        plan.settings.get_ups = get_ups;
        plan.settings.speed = speed;
        plan.settings.hold_s = hold_s;
        return Simulate(motion, std::move(plan));
      },
      "Plays a Primitive, or the file of a primitive or a sequence, as `tumbler run sim` does.\n\n"
      "It goes through the runtime, simulated drives and the twin. `from_node` is the option\n"
      "--from, `get_ups` is --get-ups. `record` keeps the flight record in a file, which must not\n"
      "exist. Throws FileError, Refused.",
      py::arg("motion"), py::kw_only(), py::arg("cycles") = 0, py::arg("branch") = "",
      py::arg("from_node") = "", py::arg("get_ups") = 0, py::arg("speed") = 1.0,
      py::arg("hold_s") = 2.0, py::arg("twin") = py::none(), py::arg("drives") = py::none(),
      py::arg("faults") = py::none(), py::arg("bus_faults") = py::none(),
      py::arg("record") = py::none());
}

/// What became of robots that are not the model: one in each entry, and in each row of `sigma`.
struct RobustnessMap {
  std::vector<std::string> verdicts, reasons;
  std::vector<bool> stands, judged;
  std::vector<double> left_s;
  std::shared_ptr<const std::vector<double>> sigma;
  std::vector<std::string> parameters;  ///< The columns of `sigma`.
  std::string json;

  [[nodiscard]] Share share() const {
    return ShareOf(static_cast<int>(std::ranges::count(stands, true)),
                   static_cast<int>(std::ranges::count(judged, true)));
  }
};

RobustnessMap MapOf(const RobustnessResult& result) {
  RobustnessMap map;
  map.json = ToJson(result).Dump(0);
  std::vector<double> sigma;
  for (const TrialOutcome& trial : result.trials) {
    map.verdicts.emplace_back(ToString(trial.verdict));
    map.reasons.push_back(trial.reason);
    map.stands.push_back(trial.stands());
    map.judged.push_back(trial.judged());
    map.left_s.push_back(trial.left_s < 0 ? std::numeric_limits<double>::quiet_NaN()
                                          : trial.left_s);
    for (const RobotVariation::Deviate& deviate : trial.variation.deviates)
      sigma.push_back(deviate.sigma);
  }
  if (!result.trials.empty()) {
    for (const RobotVariation::Deviate& deviate : result.trials.front().variation.deviates)
      map.parameters.push_back(deviate.name);
  }
  map.sigma = std::make_shared<const std::vector<double>>(std::move(sigma));
  return map;
}

template <class T>
T SpreadAs(const SpreadName& name, const py::object& value, const char* what) {
  try {
    return value.cast<T>();
  } catch (const py::cast_error&) {
    throw py::type_error(fmt::format("spreads: {} is to be {}", name.key, what));
  }
}

/// A number, or a dictionary with `from` and `to`, or with `factor`.
GroundSpread GroundSpreadOf(const SpreadName& name, const py::object& value) {
  GroundSpread spread = 0;
  if (py::isinstance<py::dict>(value)) {
    const auto numbers =
        SpreadAs<std::map<std::string, double>>(name, value, "a number or a dictionary of numbers");
    if (numbers.size() == 1 && numbers.contains("factor")) {
      spread = GroundSpread::EitherWay{numbers.at("factor")};
    } else if (numbers.size() == 2 && numbers.contains("from") && numbers.contains("to")) {
      spread = GroundSpread::Between{numbers.at("from"), numbers.at("to")};
    } else {
      throw py::value_error(
          fmt::format("{}: a range is {{\"from\": A, \"to\": B}} or {{\"factor\": F}}; allowed: {}",
                      name.key, name.limits.Allowed()));
    }
  } else {
    spread = SpreadAs<double>(name, value, "a number or a dictionary of numbers");
  }
  if (const std::string mistake = MistakeIn(spread, name.limits); !mistake.empty())
    throw py::value_error(fmt::format("{}: {}", name.key, mistake));
  return spread;
}

void SetSpreads(const std::map<std::string, py::object>& wanted, Spreads& spreads) {
  for (const auto& [key, value] : wanted) {
    const auto* const known = std::ranges::find_if(
        kSpreadNames, [&key = key](const SpreadName& name) { return name.key == key; });
    if (known == kSpreadNames.end()) {
      std::vector<std::string> names;
      names.reserve(kSpreadNames.size());
      for (const SpreadName& name : kSpreadNames) names.emplace_back(name.key);
      throw py::value_error(
          fmt::format("spreads: '{}' is none; allowed: {}", key, fmt::join(names, ", ")));
    }
    if (const auto* ground = std::get_if<GroundSpread Spreads::*>(&known->member)) {
      spreads.** ground = GroundSpreadOf(*known, value);
      continue;
    }
    const auto number = SpreadAs<double>(*known, value, "a number");
    CheckWithin(known->key, number, 0.0, known->max);
    known->Set(number, spreads);
  }
}

RobustnessMap MapOf(const SpaceStudyResult& result) {
  RobustnessMap map;
  map.json = ToJson(result).Dump(0);
  std::vector<double> sigma;
  for (std::size_t i = 0; i < result.trials.size(); ++i) {
    const SpaceTrial& trial = result.trials[i];
    map.verdicts.emplace_back(trial.as_asked() ? "stands" : "amiss");
    map.reasons.push_back(result.ReasonOf(trial));
    map.stands.push_back(trial.as_asked());
    map.judged.push_back(true);
    map.left_s.push_back(std::numeric_limits<double>::quiet_NaN());
    for (const RobotVariation::Deviate& deviate : result.deviates[i])
      sigma.push_back(deviate.sigma);
  }
  if (!result.deviates.empty()) {
    for (const RobotVariation::Deviate& deviate : result.deviates.front())
      map.parameters.push_back(deviate.name);
  }
  map.sigma = std::make_shared<const std::vector<double>>(std::move(sigma));
  return map;
}

/// What robots are asked for.
struct RobotsAsked {
  RobustnessStudy study;
  WorkPlan plan;
  std::string branch;
  std::optional<double> hold_s, period_s;
};

/// @param work  plays them while Python goes on; gets a function that is told how many are known,
///              which may be empty.
RobustnessMap Watched(
    const std::string& motion, const py::object& progress,
    const std::function<std::optional<RobustnessMap>(
        std::atomic<bool>& stop, const std::function<void(int)>& progress)>& work) {
  ProgressCallback callback(progress);
  std::optional<RobustnessMap> map = Interruptibly([&](std::atomic<bool>& stop) {
    std::function<void(int)> tell;
    if (callback.wanted()) {
      tell = [&](int known) {
        if (!callback.Call([known] { return py::int_(known); })) stop = true;
      };
    }
    return Reading(motion, [&](const std::string& /*path*/) { return work(stop, tell); });
  });
  callback.Rethrow();
  if (!map) throw Refused("the study was stopped before all robots were played");
  return std::move(*map);
}

RobustnessMap MapInSpace(const RobotsAsked& asked, const py::object& progress) {
  const auto refuse = [](bool given, const char* name) {
    if (!given) return;
    throw py::value_error(
        fmt::format("{}: is for motions in the plane so far; this one is of a robot in space, for "
                    "which there are robots, cycles, branch, seed, scale, spreads, hold_s, "
                    "period_s, threads, progress",
                    name));
  };
  refuse(asked.study.run.get_ups != 0, "get_ups");
  refuse(!asked.study.drives.empty(), "drives");
  refuse(!asked.study.twin.empty(), "twin");
  refuse(asked.study.lanes, "lanes");
  SpaceStudy study;
  study.motion = asked.study.motion;
  study.cycles = asked.study.run.cycles;
  study.branch = asked.branch;
  study.robots = asked.plan.robots;
  study.seed = asked.study.seed;
  study.scale = asked.study.scale;
  study.spreads = asked.study.spreads;
  study.hold_s = asked.hold_s.value_or(study.hold_s);
  study.period_s = asked.period_s.value_or(study.period_s);
  study.threads = asked.plan.threads;
  CheckWithin("period_s", study.period_s, 1e-4, 0.1);
  return Watched(study.motion, progress,
                 [&study](std::atomic<bool>& stop, const std::function<void(int)>& tell) {
                   study.interrupt = &stop;
                   study.progress = tell;
                   const SpaceStudyResult result = RunSpaceStudy(study);
                   const bool all = static_cast<int>(result.trials.size()) == study.robots;
                   return all ? std::optional(MapOf(result)) : std::nullopt;
                 });
}

/// Plays robots. @param progress  is called with how many are known.
RobustnessMap MapRobots(const py::object& motion, RobotsAsked asked, const py::object& progress) {
  RobustnessStudy& study = asked.study;
  WorkPlan& plan = asked.plan;
  constexpr double kHold_s = 2;  // in the plane
  study.run.hold_s = asked.hold_s.value_or(kHold_s);
  CheckWithin("robots", plan.robots, 1, 10000000);
  CheckWithin("cycles", study.run.cycles, 0, 100000);
  CheckWithin("scale", study.scale, 0.0, 10.0);
  CheckWithin("hold_s", study.run.hold_s, 0.0, 3600.0);
  CheckWithin("get_ups", study.run.get_ups, 0, study.lanes ? 0 : 1000);
  CheckWithin("threads", plan.threads, 0, 1024);
  if (plan.threads == 0)
    plan.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const MotionPath path(motion);
  study.motion = path.path();
  const SequenceFile file =
      Reading(study.motion, [](const std::string& p) { return LoadMotion(p); });
  study.run.branch = BranchOf(file, study.motion, asked.branch, study.run.cycles);
  if (file.primitives.front().entry.is_in_space()) return MapInSpace(asked, progress);
  if (asked.period_s)
    throw py::value_error("period_s: is for motions of robots in space; this one is in the plane");
  return Watched(study.motion, progress,
                 [&](std::atomic<bool>& stop, const std::function<void(int)>& tell) {
                   plan.interrupt = &stop;
                   plan.progress = tell;
                   WorkDone work = RunStudy(study, plan, Processes());
                   return work.result ? std::optional(MapOf(*work.result)) : std::nullopt;
                 });
}

py::array Booleans(const std::vector<bool>& values) {
  return ArrayOf(std::vector<std::uint8_t>(values.begin(), values.end())).view("bool");
}

py::tuple StateOfMap(const RobustnessMap& self) {
  return py::make_tuple(self.verdicts, self.reasons, self.stands, self.judged, self.left_s,
                        *self.sigma, self.parameters, self.json);
}

RobustnessMap MapOfState(const py::tuple& state) {
  RobustnessMap map;
  map.verdicts = state[0].cast<std::vector<std::string>>();
  map.reasons = state[1].cast<std::vector<std::string>>();
  map.stands = state[2].cast<std::vector<bool>>();
  map.judged = state[3].cast<std::vector<bool>>();
  map.left_s = state[4].cast<std::vector<double>>();
  map.sigma = std::make_shared<const std::vector<double>>(state[5].cast<std::vector<double>>());
  map.parameters = state[6].cast<std::vector<std::string>>();
  map.json = state[7].cast<std::string>();
  return map;
}

/// Whether the same became of the same robots.
bool SameMap(const RobustnessMap& a, const RobustnessMap& b) {
  const auto same = [](double x, double y) { return x == y || (std::isnan(x) && std::isnan(y)); };
  return a.verdicts == b.verdicts && a.reasons == b.reasons && a.parameters == b.parameters &&
         std::ranges::equal(a.left_s, b.left_s, same) && *a.sigma == *b.sigma;
}

void BindRobustnessMap(py::module_& module) {
  py::class_<RobustnessMap>(module, "RobustnessMap",
                            "What became of robots that are not the model, one in each row.")
      .def_property_readonly(
          "verdicts", [](const RobustnessMap& self) { return TextArray(self.verdicts); },
          "'stands', 'amiss', 'fell', 'overlap', 'fault', 'got up' or 'not judged' of each robot; "
          "in\n"
          "space 'stands' or 'amiss'.")
      .def_property_readonly(
          "stands", [](const RobustnessMap& self) { return Booleans(self.stands); },
          "Whether each robot did everything as asked.")
      .def_property_readonly(
          "judged", [](const RobustnessMap& self) { return Booleans(self.judged); },
          "Whether that was judged of each robot.")
      .def_property_readonly(
          "reasons", [](const RobustnessMap& self) { return py::tuple(py::cast(self.reasons)); },
          "In words; empty where it stands.")
      .def_property_readonly(
          "left_s", [](const RobustnessMap& self) { return ArrayOf(self.left_s); },
          "When each robot left the model's way for good [s since its motion began]; NaN: it did "
          "not,\n"
          "or moves in space.")
      .def_readonly("parameters", &RobustnessMap::parameters,
                    "What robots differ in: the names of the columns of `sigma`.")
      .def_property_readonly(
          "sigma",
          [](const RobustnessMap& self) {
            return ViewOf(std::span<const double>(*self.sigma), self.sigma,
                          {static_cast<py::ssize_t>(self.verdicts.size()),
                           static_cast<py::ssize_t>(self.parameters.size())});
          },
          "By how much each robot differs in each parameter [standard deviations].")
      .def_property_readonly(
          "share",
          [](const RobustnessMap& self) {
            const Share share = self.share();
            return share.of == 0 ? std::numeric_limits<double>::quiet_NaN() : share.value();
          },
          "Of the robots that stand, among those that were judged; NaN: none was.")
      .def_property_readonly(
          "share_95",
          [](const RobustnessMap& self) {
            const Share share = self.share();
            return std::pair(share.low, share.high);
          },
          "Confidence interval of the share at 95 %.")
      .def_property_readonly(
          "summary",
          [](const RobustnessMap& self) {
            return py::module_::import("json").attr("loads")(self.json);
          },
          "The figures that `tumbler robustness --json` writes.")
      .def("__len__", [](const RobustnessMap& self) { return self.verdicts.size(); })
      .def("__eq__", &SameMap, py::is_operator())
      .def(py::pickle(&StateOfMap, &MapOfState))
      .def("__repr__", [](const RobustnessMap& self) {
        const Share share = self.share();
        return "<tumbler.RobustnessMap " + std::to_string(share.count) + " of " +
               std::to_string(share.of) + " that were judged stand>";
      });
}

void BindRobustness(py::module_& module) {
  DefineFunction(
      module, "robustness",
      [](const py::object& motion, int robots, int cycles, const std::string& branch,
         std::uint64_t seed, double scale, const std::map<std::string, py::object>& spreads,
         std::optional<double> hold_s, int get_ups, const FilePath& drives, const FilePath& twin,
         bool lanes, int threads, const py::object& progress, std::optional<double> period_s) {
        RobotsAsked asked;
        asked.branch = branch;
        asked.hold_s = hold_s;
        asked.period_s = period_s;
        RobustnessStudy& study = asked.study;
        study.run.cycles = cycles;
        study.run.get_ups = get_ups;
        study.seed = seed;
        study.scale = scale;
        study.drives = NameOf(drives);
        study.twin = NameOf(twin);
        study.lanes = lanes;
        SetSpreads(spreads, study.spreads);
        asked.plan.robots = robots;
        asked.plan.threads = threads;
        return MapRobots(motion, std::move(asked), progress);
      },
      "Plays a motion on robots that differ from the model, as tumbler robustness does.\n\n"
      "It is a Primitive, or the file of a primitive or a sequence. `spreads` are standard\n"
      "deviations by their names in its JSON, in place of the defaults; friction, stiffness and\n"
      "damping may have a range instead: {\"from\": 0.15, \"to\": 1.0} of values, {\"factor\": "
      "10}\n"
      "of factors either way. Robot number i of a seed\n"
      "is the same whatever the number of robots and threads (0: one for each core). `progress` "
      "is\n"
      "called now and then with how many are known; when it returns False the work ends by\n"
      "Refused. `hold_s` is 2 in the plane and 0 in space, if left out. Of a robot in space\n"
      "setpoints change every `period_s` (2.5 ms if left out), and there are no get_ups, drives,\n"
      "twin and lanes. Throws FileError, Refused.",
      py::arg("motion"), py::kw_only(), py::arg("robots") = 100, py::arg("cycles") = 0,
      py::arg("branch") = "", py::arg("seed") = 1, py::arg("scale") = 1.0,
      py::arg("spreads") = py::dict(), py::arg("hold_s") = py::none(), py::arg("get_ups") = 0,
      py::arg("drives") = py::none(), py::arg("twin") = py::none(), py::arg("lanes") = false,
      py::arg("threads") = 0, py::arg("progress") = py::none(), py::arg("period_s") = py::none());
}

}  // namespace

void BindRehearsal(py::module_& module) {
  BindSimulate(module);
  BindRobustnessMap(module);
  BindRobustness(module);
}

}  // namespace tumbler
