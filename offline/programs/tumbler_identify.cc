// tumbler identify: from a robot's records to its model, and to a motion that may be tried on it.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/index.h"
#include "common/files/command_line.h"
#include "common/files/held_results.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/temporary_folder.h"
#include "common/files/toml_reader.h"
#include "offline/problem/posterior_toml.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/programs/identify_text.h"
#include "offline/studies/excitation.h"
#include "offline/studies/gate.h"
#include "offline/studies/identified_drives.h"
#include "offline/studies/identified_model.h"
#include "offline/studies/identify_page.h"
#include "offline/studies/recorded_motion.h"
#include "offline/studies/recorded_robot.h"
#include "offline/studies/robot_fit.h"
#include "offline/studies/stated_motors.h"

namespace tumbler {
namespace {

constexpr const char* kIdentifyExitCodes =
    R"(Exit codes:
  0    done; gate: it is open
  1    wrong usage, or a file that cannot be used or written: nothing was written, unless it
       is standard output that could not be
  2    excite: no motion is safe; fit, gate: a motion cannot be played so
  4    fit: the records are not explained, the model is an effective one, or it stands in a motion
       of --failed; gate: it is closed
  130  interrupted)";

namespace fs = std::filesystem;

constexpr int kNoDraws = -1;  // --draws was not given

struct IdentifyArguments {
  std::string task, out;                       // excite
  std::vector<std::string> records, held_out;  // fit
  std::string prior;
  double weight_kg = 0;
  std::string motion, posterior, drives, json;  // gate
  std::vector<std::string> failed;
  int draws = kNoDraws;
  ExcitationSettings excitation;
  std::optional<std::uint64_t> seed;
  int encoder_counts = ReadingSettings{}.encoder_counts_per_turn;
  bool quiet = false;
};

ExitStatus Excite(const IdentifyArguments& arguments) {
  ExcitationSettings settings = arguments.excitation;
  settings.interrupt = &EndOnSignals();
  if (arguments.seed) settings.seed = *arguments.seed;
  if (!arguments.quiet)
    settings.say = [](const std::string& text) { fmt::print(stderr, "{}\n", text); };
  if (arguments.out == "-")
    throw FileError(arguments.out, 0, "", "a primitive is written to a file; './-' is one");
  CheckWritable(arguments.out);
  std::vector<std::string> read = settings.after;
  read.push_back(arguments.task);
  read.push_back(LoadTask(arguments.task).robot_file);
  CheckDistinct(read, {arguments.out});
  const HeldResults held({arguments.out});
  const Excitation found = MakeExcitation(arguments.task, settings);
  if (*settings.interrupt) {
    fmt::print(stderr, "interrupted: no file was written\n");
    return ExitStatus::kInterrupted;
  }
  if (!found.file) {
    fmt::print(stderr, "no motion was found: {}\nno file was written\n", found.cause);
    return ExitStatus::kRefused;
  }
  const std::string text = ToToml(*found.file);
  ParsePrimitive(text, "the new primitive");  // The text must read back.
  PendingFile(arguments.out, text).Commit();
  fmt::print("{}: the most telling of {} motions, of which {} are safe for the model\n",
             found.file->primitive.name.view(), found.tried, found.safe);
  PrintExpected(found, settings.after);
  for (std::size_t j = 0; j < found.joint_rad.size(); ++j) {
    fmt::print("  {} swings by {:.3g} rad\n", found.file->primitive.joints[j].name.view(),
               found.joint_rad[j]);
  }
  fmt::print(
      "  {} robots that differ twice as much as may be expected played it: all rest where they "
      "began, turned by at most {:.3g} rad, needed at most {:.3g} N m\n",
      found.robots, found.pitch_rad, found.torque_nm);
  fmt::print("  primitive {}\n", arguments.out);
  return ExitStatus::kDone;
}

/// Makes all records those of the first one's model.
void TakeOneModel(std::vector<RecordedMotion>& records) {
  for (RecordedMotion& record : records) TakeModelOf(records.front(), record);
}

void CheckOneKindOfDrives(const std::vector<RecordedMotion>& records) {
  const RecordedMotion& first = records.front();
  for (const RecordedMotion& record : records) {
    const std::string difference =
        DifferenceOf(FactsOf(record.drives), FactsOf(first.drives), true);
    if (!difference.empty()) {
      throw std::invalid_argument(
          fmt::format("{}: was made with other drives than {}: {}; give records of one drives file",
                      record.name, first.name, difference));
    }
  }
}

/// Checks that no record is there twice, nor one of the prior's: it would count as two.
void CheckNoneTwice(const std::vector<RecordedMotion>& records, const PosteriorFile* before,
                    const std::string& before_name) {
  std::vector<std::string> fingerprints;
  for (const RecordedMotion& record : records) {
    const std::string fingerprint = record.Fingerprint();
    const auto same = std::ranges::find(fingerprints, fingerprint);
    if (same != fingerprints.end()) {
      throw std::invalid_argument(fmt::format(
          "{}: holds the same motion, with the same replies, as {}; what is given twice "
          "would count as two: give each record once",
          record.name, records[static_cast<std::size_t>(same - fingerprints.begin())].name));
    }
    fingerprints.push_back(fingerprint);
    if (before == nullptr) continue;
    const auto fitted = std::ranges::find(before->fingerprints, fingerprint);
    if (fitted == before->fingerprints.end()) continue;
    throw std::invalid_argument(fmt::format(
        "{}: is one of the records of {}, which has it as {}; what is taken into account twice "
        "would "
        "count as two: give new records only",
        record.name, before_name,
        before->records[static_cast<std::size_t>(fitted - before->fingerprints.begin())]));
  }
}

/// Takes what was stated of its drives' motors from a posterior, in place of what is stated now:
/// that may be what the posterior has found.
void TakeStated(const PosteriorDrives& drives, RecordedMotion& record) {
  const std::vector<MotorFacts> stated = StatedIn(drives);
  for (std::size_t j = 0; j < record.joint_count(); ++j) {
    const std::string& joint = record.drives.drives[j].joint;
    const auto at = std::ranges::find(drives.of_joint, joint, &PosteriorDrive::joint);
    if (at != drives.of_joint.end())
      record.joints[j].motor = stated[static_cast<std::size_t>(at - drives.of_joint.begin())];
  }
}

/// What an earlier posterior says, for records of these drives.
PosteriorFile LoadPrior(const IdentifyArguments& arguments, const RecordedMotion& first,
                        const FitPrior& own) {
  const std::string& path = arguments.prior;
  PosteriorFile before = LoadPosterior(path, &first.scene);
  if (before.effective) {
    throw FileError(path, 0, "effective",
                    "is true: what does not explain its records says nothing of the robot; give a "
                    "posterior of a fit that does, or none");
  }
  if (before.information.empty()) {
    throw FileError(path, 0, "hessian",
                    "is missing: the file is of an earlier version, whose covariance does not tell "
                    "how records are to be weighed; fit its records again, together with the new "
                    "ones");
  }
  const bool weighs = arguments.weight_kg > 0;
  if (weighs && !before.weighed) {
    throw FileError(path, 0, "weighed",
                    "is false: its robot was not weighed, and this one is (--weight-kg); give both "
                    "alike, or fit all records at once");
  }
  if (weighs && before.weight_kg > 0 && before.weight_kg != arguments.weight_kg) {
    throw FileError(path, 0, "weight_kg",
                    fmt::format("is {}, and --weight-kg is {}; allowed: the same, or leave "
                                "--weight-kg out, since the posterior has it",
                                before.weight_kg, arguments.weight_kg));
  }
  if (before.posterior.quantities != own.known.quantities)
    throw FileError(path, 0, "quantity", "are those of another robot than the records'");
  const PosteriorDrives drives = FactsOf(first.drives);
  if (!before.drives.of_joint.empty()) {
    const std::string difference = DifferenceOf(drives, before.drives, false);
    if (!difference.empty()) {
      throw FileError(path, 0, "drive",
                      fmt::format("is of other drives than {}: {}; give records of one drives file",
                                  first.name, difference));
    }
    ShiftZeros(before, drives);
  }
  return before;
}

/// The records of a posterior, where all of them are still there.
struct EarlierRecords {
  std::vector<RecordedMotion> records;
  std::string missing;  ///< In words, why they cannot be fitted again; empty: they can.
};

EarlierRecords ReadEarlier(const PosteriorFile& before, const std::string& before_name,
                           const ReadingSettings& reading) {
  EarlierRecords earlier;
  const auto cannot = [&earlier](const std::string& why) {
    earlier.records.clear();
    earlier.missing = why;
    return earlier;
  };
  if (before.fingerprints.empty()) return cannot("it does not tell by what they are known again");
  if (before.weighed && before.weight_kg == 0) return cannot("it does not tell the robot's weight");
  for (std::size_t i = 0; i < before.records.size(); ++i) {
    const std::string path =
        (fs::path(before_name).parent_path() / before.records[i]).lexically_normal().string();
    if (!fs::exists(path)) return cannot(path + " is not there");
    try {
      earlier.records.push_back(ReadRecordedMotion(path, reading));
    } catch (const std::exception& error) {
      return cannot(error.what());
    }
    if (earlier.records.back().Fingerprint() != before.fingerprints[i])
      return cannot(path + " is another record now, or is read with other --encoder-counts");
  }
  return earlier;
}

/// Names of records as paths from a folder, which need not be there yet: a relative one would stay
/// relative then, and have nothing in common with that of a record.
std::string FromFolder(const std::string& record, const std::string& folder) {
  return fs::proximate(fs::absolute(record), fs::absolute(folder)).string();
}

/// What `tumbler identify fit` fits, and with what.
struct FitInputs {
  std::vector<RecordedMotion> records;  ///< Of one model; those of the prior first.
  std::vector<RecordedMotion> held_out;
  std::vector<std::string> names, fingerprints;  ///< Of all that the posterior knows, in its order.
  std::optional<PosteriorFile> before;
  EarlierRecords earlier;
  FitPrior prior;
  FitSettings settings;
  bool weighed = false;
  double weight_kg = 0;  ///< What a scale said, now or before.
  /// Of the records that are given now, which a corrected drives file begins from.
  PosteriorDrives drives;
  DrivesConfig drives_config;
  std::string drives_text, drives_file;
};

/// Puts the records of the prior before the others, or lets the fit go on from what it says of
/// them.
void TakePrior(const IdentifyArguments& arguments, const ReadingSettings& reading,
               FitInputs& inputs) {
  const PosteriorFile& before = *inputs.before;
  for (std::size_t i = 0; i < before.records.size(); ++i) {
    const fs::path record = fs::path(arguments.prior).parent_path() / before.records[i];
    inputs.names.push_back(arguments.out.empty() ? record.string()
                                                 : FromFolder(record.string(), arguments.out));
  }
  inputs.fingerprints = before.fingerprints;
  if (inputs.weight_kg == 0) inputs.weight_kg = before.weight_kg;
  inputs.earlier = ReadEarlier(before, arguments.prior, reading);
  for (RecordedMotion& record : inputs.earlier.records) TakeZerosOf(inputs.drives_config, record);
  inputs.records.insert(inputs.records.begin(), inputs.earlier.records.begin(),
                        inputs.earlier.records.end());
}

FitInputs InputsOf(const IdentifyArguments& arguments) {
  ReadingSettings reading;
  reading.encoder_counts_per_turn = arguments.encoder_counts;
  const auto read = [&](const std::vector<std::string>& paths) {
    std::vector<RecordedMotion> records;
    for (const std::string& path : paths) records.push_back(ReadRecordedMotion(path, reading));
    return records;
  };
  FitInputs inputs;
  inputs.records = read(arguments.records);
  inputs.weight_kg = arguments.weight_kg;
  inputs.weighed = arguments.weight_kg > 0;
  const RecordedMotion& first = inputs.records.front();
  inputs.drives = FactsOf(first.drives);
  inputs.drives_config = first.drives;
  inputs.drives_text = first.drives_text;
  inputs.drives_file = first.drives_file;
  std::vector<RecordedMotion> all = inputs.records;
  for (RecordedMotion& record : read(arguments.held_out)) all.push_back(std::move(record));
  CheckOneKindOfDrives(all);
  TakeOneModel(all);
  if (!arguments.prior.empty()) {
    // A weight that the posterior has need not be given again.
    inputs.weighed = LoadPosterior(arguments.prior).weighed || inputs.weighed;
    inputs.before = LoadPrior(arguments, first, PriorOfRecords(inputs.records, inputs.weighed));
  }
  CheckNoneTwice(all, inputs.before ? &*inputs.before : nullptr, arguments.prior);
  const std::size_t given = inputs.records.size();
  if (inputs.before) TakePrior(arguments, reading, inputs);
  for (std::size_t i = 0; i < given; ++i) {
    inputs.names.push_back(arguments.out.empty() ? all[i].name
                                                 : FromFolder(all[i].name, arguments.out));
    inputs.fingerprints.push_back(all[i].Fingerprint());
  }
  const std::size_t fitted = inputs.records.size();
  inputs.records.insert(inputs.records.end(), all.begin() + static_cast<std::ptrdiff_t>(given),
                        all.end());
  TakeOneModel(inputs.records);
  if (inputs.before) {
    // Quantities go on from where the first fit began.
    for (RecordedMotion& record : inputs.records) TakeStated(inputs.before->drives, record);
  }
  inputs.held_out.assign(inputs.records.begin() + static_cast<std::ptrdiff_t>(fitted),
                         inputs.records.end());
  inputs.records.resize(fitted);
  inputs.prior = PriorOfRecords(inputs.records, inputs.weighed);
  inputs.settings.weight_kg = inputs.weight_kg;
  if (!inputs.before) return inputs;
  if (inputs.earlier.missing.empty()) {
    inputs.settings.begin = inputs.before->posterior.mean;
  } else {
    inputs.prior.known = inputs.before->posterior;
    inputs.prior.earlier = inputs.before->information;
    inputs.prior.first_deviations = inputs.before->prior_deviations;
    inputs.prior.weighed = inputs.before->weighed;
  }
  return inputs;
}

constexpr std::array kModelFiles = {"posterior.toml", "robot.urdf", "ground.toml",
                                    "drives.toml",    "twin.toml",  "index.html"};

/// Writes the folder of a model.
void WriteModel(const IdentifyArguments& arguments, const PosteriorFile& file,
                const FitInputs& inputs, const std::string& page) {
  const RecordedMotion& first = inputs.records.front();
  std::string urdf =
      IdentifiedUrdf(first.robot_text, first.robot_file, first.scene, file.posterior);
  if (file.effective) {
    // Nothing may come before the declaration of XML.
    const std::size_t declared = urdf.starts_with("<?xml") ? urdf.find("?>") : std::string::npos;
    urdf.insert(declared == std::string::npos ? 0 : declared + 2,
                "\n<!-- AN EFFECTIVE MODEL: not the robot's quantities. -->\n");
  }
  const auto beside = [&](const char* name) { return (fs::path(arguments.out) / name).string(); };
  PendingFiles files;
  files.Add(beside("posterior.toml"), ToToml(file));
  files.Add(beside("robot.urdf"), urdf);
  files.Add(beside("ground.toml"), GroundOf(file, first.scene.contact));
  files.Add(beside("drives.toml"),
            CorrectedDrives(inputs.drives_text, inputs.drives_file, inputs.drives_config, file));
  files.Add(beside("twin.toml"), TwinOf(file));
  files.Add(beside("index.html"), page);
  files.Commit();
  fmt::print("  {}: {}\n", arguments.out, fmt::join(kModelFiles, ", "));
}

/// Refuses a folder in which a file of the model would replace one that the fit reads: the earlier
/// posterior among them, since what comes out need not be good for a prior.
void CheckModelReplacesNothing(const IdentifyArguments& arguments, const FitInputs& inputs) {
  std::vector<std::string> read = {arguments.prior};
  for (const auto* names : {&arguments.records, &arguments.held_out, &arguments.failed})
    read.insert(read.end(), names->begin(), names->end());
  for (const RecordedMotion& record : inputs.earlier.records) read.push_back(record.name);
  std::vector<std::string> files;
  for (const char* name : kModelFiles) files.push_back((fs::path(arguments.out) / name).string());
  CheckDistinct(read, files);
}

/// Says how a prior is gone on from.
void PrintPrior(const FitInputs& inputs, const std::string& prior) {
  if (!inputs.before) return;
  if (inputs.earlier.missing.empty()) {
    fmt::print("{}: its {} records are fitted again, together with the new ones\n", prior,
               inputs.earlier.records.size());
    return;
  }
  fmt::print(
      "{}: goes on from what it says of its records, which holds near its robot only, for they "
      "cannot be fitted again: {}\n",
      prior, inputs.earlier.missing);
}

/// A motion is played on its own robot with the masses and lengths that were identified: its feet,
/// joints and limits have to be those of the identified one.
/// @param urdf, name  of that.
void CheckIsOfRobot(const std::string& motion, const std::string& urdf, const std::string& name) {
  const SequenceFile file = LoadMotion(motion);
  PrimitiveFile first = file.PrimitiveOf(file.graph.start);
  const Scene scene = SimulatedMotion(file).scene();
  first.provenance.robot_urdf = urdf;
  first.provenance.robot_file = name;
  std::string difference;
  try {
    difference = DifferenceOf(scene, TaskOf(first).problem.scene.robot);
  } catch (const FileError& error) {
    difference = error.what();  // Its task names joints or links that this robot has not.
  }
  if (difference.empty()) return;
  throw std::invalid_argument(fmt::format(
      "{}: is a motion of another robot than that of {}: {}; give "
      "a motion whose URDF differs from that in masses, centres of mass along the link's "
      "x, inertias and lengths of links only",
      motion, name, difference));
}

/// The drives of the records, with what was stated of their motors.
PosteriorDrives DrivesOf(const FitInputs& inputs) {
  PosteriorDrives drives = inputs.drives;
  for (std::size_t j = 0; j < drives.of_joint.size(); ++j) {
    const MotorFacts& stated = inputs.records.front().joints[j].motor;
    PosteriorDrive& drive = drives.of_joint[j];
    drive.torque_factor = stated.torque_factor;
    drive.torque_time_constant_s = stated.torque_time_constant_s;
    drive.velocity_filter_s = stated.velocity_filter_s;
  }
  return drives;
}

/// A motion that the robot has failed in.
struct FailedIn {
  std::string motion;
  std::function<bool(const std::vector<double>&)> fails;  ///< See FailsIn.
};

/// Motions that the robot has failed in, played with the drives of the records.
std::vector<FailedIn> FailedMotions(const std::vector<std::string>& motions,
                                    const FitInputs& inputs) {
  if (motions.empty()) return {};
  const RecordedMotion& first = inputs.records.front();
  PosteriorFile like;
  like.posterior = inputs.prior.known;
  like.drives = DrivesOf(inputs);
  const TemporaryFolder folder;  // The drives are read when the functions are made.
  std::string drives;
  if (!inputs.drives_text.empty()) {
    drives = (folder.path() / fs::path(inputs.drives_file).filename()).string();
    PendingFile(drives, inputs.drives_text).Commit();
  }
  std::vector<FailedIn> failed;
  for (const std::string& motion : motions) {
    CheckIsOfRobot(motion, first.robot_text, first.robot_file);
    failed.push_back({motion, FailsIn(motion, drives, like)});
  }
  return failed;
}

/// Whether a model fails wherever the robot did. Warns where it does not.
bool FailsWhereTheRobotDid(const std::vector<FailedIn>& failed, const RobotPosterior& posterior) {
  bool all = true;
  for (const FailedIn& in : failed) {
    if (in.fails(posterior.mean)) continue;
    all = false;
    fmt::print(
        "warning: the model does not fail in {}, in which the robot failed: it is not to be "
        "believed where it stands\n",
        in.motion);
  }
  return all;
}

ExitStatus Fit(const IdentifyArguments& arguments) {
  std::atomic<bool>& end = EndOnSignals();
  FitInputs inputs = InputsOf(arguments);
  FitSettings& settings = inputs.settings;
  settings.interrupt = &end;
  if (!arguments.quiet)
    settings.say = [](const std::string& text) { fmt::print(stderr, "{}\n", text); };
  if (!arguments.out.empty()) {
    CheckModelReplacesNothing(arguments, inputs);
    CheckFolderWritable(arguments.out);
  }
  PrintPrior(inputs, arguments.prior);
  for (const auto* records : {&inputs.records, &inputs.held_out})
    for (const RecordedMotion& record : *records) PrintReadings(record);
  const std::vector<FailedIn> failed = FailedMotions(arguments.failed, inputs);
  if (!failed.empty()) {
    settings.fails = [&failed](const std::vector<double>& robot) {
      return std::ranges::all_of(failed, [&](const FailedIn& in) { return in.fails(robot); });
    };
  }
  const FitOutcome fit = FitRobot(inputs.records, inputs.prior, settings);
  if (fit.interrupted) {
    fmt::print(stderr, "interrupted: no file was written\n");
    return ExitStatus::kInterrupted;
  }
  PrintFit(fit, settings);
  PrintFarOff(fit.posterior, inputs.prior.known);
  const bool contradicted = !FailsWhereTheRobotDid(failed, fit.posterior);
  std::vector<FitResiduals> predicted;
  if (!inputs.held_out.empty()) {
    predicted = ResidualsOf(inputs.held_out, fit.posterior, settings.per_tick);
    for (const FitResiduals& record : predicted)
      fmt::print("{} was held out: chi {:.3g}\n", record.record, record.chi);
  }
  if (!arguments.out.empty()) {
    PosteriorFile file;
    file.posterior = fit.posterior;
    file.information = fit.information;
    file.prior_deviations = fit.first_deviations;
    file.effective = fit.effective;
    file.chi = fit.chi;
    file.chi_max = settings.chi_max;
    file.weighed = inputs.weighed;
    file.weight_kg = inputs.weight_kg;
    file.records = inputs.names;
    file.fingerprints = inputs.fingerprints;
    file.drives = DrivesOf(inputs);
    WriteModel(arguments, file, inputs, IdentifyPage(fit, settings, predicted));
  }
  return fit.effective || contradicted ? ExitStatus::kAmiss : ExitStatus::kDone;
}

/// The URDF that is beside a posterior.
std::string UrdfOf(const std::string& posterior) {
  return (fs::path(posterior).parent_path() / "robot.urdf").string();
}

/// Refuses a motion of another robot than that whose URDF is beside a posterior.
void CheckIsIdentified(const std::string& motion, const std::string& posterior) {
  const std::string urdf = UrdfOf(posterior);
  if (fs::exists(urdf)) CheckIsOfRobot(motion, ReadTextFile(urdf), urdf);
}

/// Refuses a posterior that leaves out what a fit estimates: the gate's robots would not differ in
/// it.
void CheckKnowsAll(const std::string& path, const RobotPosterior& posterior, const Scene& scene) {
  for (const RobotQuantity& quantity : PriorOf(scene).quantities) {
    if (std::ranges::find(posterior.quantities, quantity) != posterior.quantities.end()) continue;
    throw FileError(path, 0, "quantity",
                    fmt::format("has none of '{}'; allowed: all that a fit estimates, as "
                                "`tumbler identify fit` writes them",
                                NameOf(quantity)));
  }
}

ExitStatus Gate(const IdentifyArguments& arguments) {
  const Scene scene = SimulatedMotion(LoadMotion(arguments.motion)).scene();
  const PosteriorFile file = LoadPosterior(arguments.posterior, &scene);
  CheckKnowsAll(arguments.posterior, file.posterior, scene);
  CheckIsIdentified(arguments.motion, arguments.posterior);
  for (const std::string& failed : arguments.failed) CheckIsIdentified(failed, arguments.posterior);
  CheckResult(arguments.json);
  std::vector<std::string> read = {arguments.motion, arguments.posterior, arguments.drives,
                                   UrdfOf(arguments.posterior)};
  read.insert(read.end(), arguments.failed.begin(), arguments.failed.end());
  CheckDistinct(read, {arguments.json});
  GateSettings settings;
  if (arguments.draws != kNoDraws) settings.draws = arguments.draws;
  settings.failed = arguments.failed;
  settings.interrupt = &EndOnSignals();
  if (arguments.seed) settings.seed = *arguments.seed;
  const GateOutcome outcome = PassGate(arguments.motion, arguments.drives, file, settings);
  if (outcome.interrupted) {
    fmt::print(stderr, "interrupted: the gate stays closed, and no file was written\n");
    return ExitStatus::kInterrupted;
  }
  PrintGate(arguments.json == "-" ? stderr : stdout, outcome, settings, file,
            {arguments.posterior, arguments.drives});
  if (!arguments.json.empty()) {
    WriteResult(arguments.json, ToJson(outcome, settings, arguments.motion, arguments.drives,
                                       arguments.posterior, file.effective));
  }
  return outcome.open() ? ExitStatus::kDone : ExitStatus::kAmiss;
}

/// Refuses a record behind that of --held-out: it would be fitted, which may not be meant.
void CheckHeldOut(int argc, char** argv) {
  constexpr std::string_view kOption = "--held-out";
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool with_its_record = word.starts_with(std::string(kOption) + "=");
    const int behind = i + (with_its_record ? 1 : 2);
    if ((word != kOption && !with_its_record) || behind >= argc || argv[behind][0] == '-') continue;
    throw UsageError(
        std::string(kOption),
        fmt::format("takes one record each time, and {} is behind it; to hold that out, too, give "
                    "the option again, and records that are fitted before it",
                    argv[behind]));
  }
}

void DeclareExcite(CommandLine& line, IdentifyArguments& arguments) {
  CommandLine excite =
      line.Subcommand("excite", "Makes a motion from whose record a robot can be told");
  excite
      .Option("TASK", arguments.task,
              "Task file (TOML) of any motion that begins at rest where this one is to begin and "
              "end, such as standing or lying")
      .Required();
  excite.Option("--out", arguments.out, "Write the primitive here").Required();
  excite.Option("--duration-s", arguments.excitation.duration_s, "Of what moves, after a hold")
      .Within(0.3, 2.0)
      .ShowDefault();
  excite.Option("--candidates", arguments.excitation.candidates, "Motions that are drawn")
      .Within(1, 10000)
      .ShowDefault();
  excite
      .Option("--generations", arguments.excitation.generations,
              "Of the search about the best that was drawn; 0: none")
      .Within(0, 10000)
      .ShowDefault();
  excite
      .Option("--after", arguments.excitation.after,
              "A motion that is recorded besides: this one is to tell what its record leaves open")
      .TakesOneValueEachTime();
  excite.Seed(arguments.seed, "Seed of the motions and of the robots that play them");
  excite.Flag("--quiet", arguments.quiet, "No progress");
}

void DeclareFit(CommandLine& line, IdentifyArguments& arguments) {
  CommandLine fit = line.Subcommand("fit", "Finds the robot that explains flight records");
  fit.Option("RECORD", arguments.records, "Flight records of one robot").Required();
  fit.Option("--out", arguments.out,
             "Write posterior, URDF, ground, drives, twin and a page into this folder");
  fit.Option("--weight-kg", arguments.weight_kg,
             "The robot's mass, as weighed: tells what the drives' torque is worth")
      .Within(1e-3, 1e4);
  fit.Option("--prior", arguments.prior,
             "Posterior of earlier records of this robot; the new ones are taken into account");
  fit.Option("--held-out", arguments.held_out,
             "A record that is not fitted, but predicted, for the page; once for each")
      .TakesOneValueEachTime();
  fit.Option("--failed", arguments.failed,
             "A motion that the robot has failed in: where no model explains the records, one is "
             "looked for that fails in it, too; may be given more than once")
      .TakesOneValueEachTime();
  fit.Option("--encoder-counts", arguments.encoder_counts,
             "Of the drives' encoders for a turn of their shaft; 0: exact")
      .Within(0, 1 << 26)
      .ShowDefault();
  fit.Flag("--quiet", arguments.quiet, "No progress");
}

void DeclareGate(CommandLine& line, IdentifyArguments& arguments) {
  CommandLine gate = line.Subcommand(
      "gate", "Plays a motion in the twin of the robot that was identified, and of draws");
  gate.Option("MOTION", arguments.motion, "Primitive or sequence").Required();
  gate.Option("POSTERIOR", arguments.posterior, "posterior.toml of tumbler identify fit")
      .Required();
  gate.Option("--drives", arguments.drives,
              "Drives file of the run: the records' own, or with corrected zeros; without it, "
              "default drives with the motion's gains");
  gate.Option("--draws", arguments.draws,
              fmt::format("Robots at {} standard deviations, beside the mean; without it {}. Of an "
                          "effective model at {}; without it {}",
                          GateDraws{}.deviations, GateDraws{}.count, kDrawsOfEffective.deviations,
                          kDrawsOfEffective.count))
      .Within(0, 1000);
  gate.Option(
          "--failed", arguments.failed,
          "A motion that the robot has failed in: the model has to fail in it, too; may be given "
          "more than once")
      .TakesOneValueEachTime();
  gate.Seed(arguments.seed, "Seed of the draws");
  gate.Option("--json", arguments.json,
              "Write what was played, with which drives and twin, to this file, or - for standard "
              "output");
}

ExitStatus Main(int argc, char** argv) {
  IdentifyArguments arguments;
  CommandLine line("Finds a robot's model from its records, and says whether a motion suits it.",
                   "tumbler identify");
  line.SetFooter(kIdentifyExitCodes);
  line.RequireSubcommand();
  DeclareExcite(line, arguments);
  DeclareFit(line, arguments);
  DeclareGate(line, arguments);
  line.Parse(argc, argv);
  const std::string subcommand = line.given_subcommand();
  if (subcommand == "excite") return Excite(arguments);
  if (subcommand == "fit") CheckHeldOut(argc, argv);
  return subcommand == "fit" ? Fit(arguments) : Gate(arguments);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler identify", argc, argv, tumbler::Main);
}
