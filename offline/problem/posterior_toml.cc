#include "offline/problem/posterior_toml.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/file_keys.h"
#include "common/files/toml_reader.h"
#include "common/files/toml_writer.h"

namespace tumbler {
namespace {

constexpr FileHeader kPosteriorHeader{"tumbler-posterior", 1};

constexpr std::array kPosteriorKeys = {
    KeyOf<&PosteriorFile::effective>("effective",
                                     "chi is above its limit: no model of the robot, but one that "
                                     "moves as it did")
        .Required(),
    KeyOf<&PosteriorFile::chi>("chi", {0, 1e9}, "of the residuals, in units of their noise")
        .Required(),
    KeyOf<&PosteriorFile::chi_max>("chi_max", {0, 1e9}, "its limit; 0: not known")
        .Default("not known"),
    KeyOf<&PosteriorFile::weighed>("weighed", "otherwise masses and forces are in the drives' N m")
        .Required(),
    KeyOf<&PosteriorFile::weight_kg>("weight_kg", {0, 1e5}, "what the scale said")
        .Default("it was not weighed, or the file does not say"),
    KeyOf<&PosteriorFile::records>("records",
                                   "that were fitted; `--prior` reads those that are there again")
        .Allowed("paths from the file's folder"),
    KeyOf<&PosteriorFile::fingerprints>("fingerprints",
                                        "of what these records say, so that none counts twice")
        .Default("not known")
        .Allowed("one for each of `records`"),
};
constexpr std::array kPosteriorRateKeys = {
    KeyOf<&PosteriorDrives::rate_hz>("rate_hz", {0, 1e5},
                                     "of the control loop with which the records were made")
        .Default("not known"),
};

/// A table `[[quantity]]`.
struct QuantityEntry {
  RobotQuantity::Kind kind = RobotQuantity::Kind::kMass;
  std::string of;
  double mean = 0, prior_deviation = 0;
  std::optional<double> unbounded_mean;
};

constexpr std::array<std::string_view, RobotQuantity::kKinds> KindNames() {
  return {"mass",         "mass_centre",   "gyration",      "friction",  "stiffness",
          "damping",      "creep_speed",   "slope",         "zero",      "viscous_friction",
          "dry_friction", "rotor_inertia", "torque_factor", "reply_lag", "velocity_filter",
          "torque_lag",   "length"};
}
constexpr std::array kQuantityNames = KindNames();
constexpr Range kCoordinate{-1e6, 1e6};
constexpr Range kGain{0, 1e6};
constexpr std::array kQuantityKeys = {
    KeyOf<&QuantityEntry::kind>("kind", kQuantityNames, "what it is").Required(),
    KeyOf<&QuantityEntry::of>("of", "link or joint").Default("of the ground, or of all"),
    KeyOf<&QuantityEntry::mean>("mean", kCoordinate,
                                "coordinate: the value, or the logarithm of what is positive")
        .Allowed("what a robot can have")
        .Required(),
    KeyOf<&QuantityEntry::prior_deviation>("prior_deviation", {0, 1e6, true},
                                           "of the coordinate, before the first record")
        .Required(),
    KeyOf<&QuantityEntry::unbounded_mean>("unbounded_mean", kCoordinate,
                                          "what the mean would be if nothing had to be positive")
        .Default("`mean`"),
};
constexpr std::array kPosteriorDriveKeys = {
    KeyOf<&PosteriorDrive::joint>("joint", "that it moves").Required(),
    KeyOf<&PosteriorDrive::protocol>("protocol", "").Required(),
    KeyOf<&PosteriorDrive::kp_nm_per_rad>("kp_nm_per_rad", kGain, "at the joint").Required(),
    KeyOf<&PosteriorDrive::kd_nm_s_per_rad>("kd_nm_s_per_rad", kGain, "at the joint").Required(),
    KeyOf<&PosteriorDrive::direction>("direction", {-1, 1}, "as in the drives file").Required(),
    KeyOf<&PosteriorDrive::gear_ratio>("gear_ratio", {0, 1e4, true}, "likewise").Required(),
    KeyOf<&PosteriorDrive::zero_offset_rad>("zero_offset_rad", {-100, 100}, "likewise").Required(),
    KeyOf<&PosteriorDrive::torque_factor>("torque_factor", {0.1, 10},
                                          "likewise, before anything was fitted"),
    KeyOf<&PosteriorDrive::torque_time_constant_s>("torque_time_constant_s", {0, 0.1}, "likewise"),
    KeyOf<&PosteriorDrive::velocity_filter_s>("velocity_filter_s", {0, 0.1}, "likewise"),
};

}  // namespace

std::string ToToml(const PosteriorFile& file) {
  TomlWriter writer("a posterior");
  writer.Line("# What records say of one robot, by tumbler identify fit.");
  if (file.effective) {
    writer.Line(
        "# AN EFFECTIVE MODEL: it moves as the robot did in the records, but does not explain");
    writer.Line("# them. Its quantities are not the robot's.");
  }
  writer.Text("format", kPosteriorHeader.format);
  writer.Line(fmt::format("version = {}", kPosteriorHeader.version));
  writer.Line(fmt::format("effective = {}", file.effective));
  writer.Number("chi", file.chi);
  writer.Number("chi_max", file.chi_max);
  writer.Line(fmt::format("weighed = {}", file.weighed));
  if (file.weight_kg > 0) writer.Number("weight_kg", file.weight_kg);
  writer.Texts("records", file.records);
  if (!file.fingerprints.empty()) writer.Texts("fingerprints", file.fingerprints);
  if (!file.drives.of_joint.empty()) writer.Number("rate_hz", file.drives.rate_hz);
  const std::size_t n = file.posterior.size();
  writer.Line("# Of the quantities below, in their order and coordinates, row by row.");
  writer.Numbers("covariance", file.posterior.covariance);
  if (!file.information.empty()) {
    writer.Line("# For a fit of further records (--prior): the objective of this one, likewise.");
    writer.Numbers("hessian", file.information.hessian);
    writer.Numbers("gradient_covariance", file.information.gradient_covariance);
  }
  for (std::size_t i = 0; i < n; ++i) {
    const RobotQuantity& quantity = file.posterior.quantities[i];
    const QuantityFacts& facts = FactsOf(quantity.kind);
    const double deviation = file.posterior.DeviationOf(i);
    writer.Line("");
    writer.Line(fmt::format("# {}: {:.6g} {}, standard deviation {:.2g}{}", NameOf(quantity),
                            file.posterior.ValueOf(i), facts.unit,
                            facts.logarithmic ? 100 * deviation : deviation,
                            facts.logarithmic ? " %" : ""));
    if (deviation > 0.5 * file.prior_deviations[i])
      writer.Line("# not identifiable from these records");
    writer.Line("[[quantity]]");
    writer.Text("kind", facts.name);
    if (!quantity.of.empty()) writer.Text("of", quantity.of);
    writer.Number("mean", file.posterior.mean[i]);
    writer.Number("prior_deviation", file.prior_deviations[i]);
    if (!file.information.empty()) writer.Number("unbounded_mean", file.information.centre[i]);
  }
  for (const PosteriorDrive& drive : file.drives.of_joint) {
    writer.Line("");
    writer.Line("[[drive]]");
    WriteKeys(writer, kPosteriorDriveKeys, drive);
  }
  return writer.Take();
}

namespace {

/// A value in a message, with what it is a coordinate of.
std::string InWords(const QuantityFacts& facts, double coordinate) {
  if (!facts.logarithmic) return fmt::format("{:.6g}", coordinate);
  return fmt::format("{:.6g} (of {:.4g}{}{})", coordinate, portable::Exp(coordinate),
                     facts.unit.empty() ? "" : " ", facts.unit);
}

/// Checks that a robot can have it.
void Check(const TomlTable& table, const QuantityEntry& entry, const Scene* scene) {
  const QuantityFacts& facts = FactsOf(entry.kind);
  using Of = QuantityFacts::Of;
  if (facts.of == Of::kNothing && !entry.of.empty()) {
    table.Fail("of", fmt::format("is '{}', but there is one {} only; leave the key out", entry.of,
                                 NameOf({entry.kind, ""})));
  }
  if (facts.of != Of::kNothing && entry.of.empty()) {
    table.Fail("of",
               fmt::format("is missing; allowed: the {} whose {} it is",
                           facts.of == Of::kLink ? "link" : "joint", NameOf({entry.kind, ""})));
  }
  const double least = facts.least_coordinate(), most = facts.most_coordinate();
  if (!(entry.mean >= least && entry.mean <= most)) {
    table.Fail("mean",
               fmt::format("is {}; allowed for a {}: {} to {}", InWords(facts, entry.mean),
                           NameOf({entry.kind, ""}), InWords(facts, least), InWords(facts, most)));
  }
  const double widest = most - least;
  if (!(entry.prior_deviation <= widest)) {
    table.Fail("prior_deviation",
               fmt::format("is {:.6g}; allowed for a {}: above 0, to {:.6g}", entry.prior_deviation,
                           NameOf({entry.kind, ""}), widest));
  }
  if (scene == nullptr) return;
  try {
    static_cast<void>(CoordinateIn(*scene, {entry.kind, entry.of}));
  } catch (const std::invalid_argument& error) {
    const PlanarRobot& robot = scene->robot;
    std::vector<std::string> names;
    for (std::size_t dof = Index(robot.first_body()); dof < robot.body_names.size(); ++dof)
      if (facts.of == Of::kLink) names.push_back(robot.body_names[dof]);
    for (std::size_t j = 0; j < robot.joint_count(); ++j)
      if (facts.of == Of::kJoint) names.push_back(robot.tree.dofs[robot.DofOfJoint(j)].name);
    if (names.empty()) table.Fail("kind", error.what());
    table.Fail("of", fmt::format("is '{}', but {}; allowed: {}", entry.of, error.what(),
                                 fmt::join(names, ", ")));
  }
}

/// A matrix of all quantities that is symmetric, and has nothing below 0.
/// @param what  its diagonal.
std::vector<double> ReadMatrix(TomlTable& root, const char* key, const char* what, std::size_t n) {
  constexpr double kLargest = 1e30;  // of a quantity that is known very well
  std::vector<double> matrix = root.Numbers(key, {-kLargest, kLargest}, n * n);
  for (std::size_t i = 0; i < n; ++i) {
    if (!(matrix[i * n + i] > 0)) {
      root.Fail(key, fmt::format("has a {} of {:.6g} in row {}; allowed: above 0", what,
                                 matrix[i * n + i], i + 1));
    }
    for (std::size_t k = 0; k < i; ++k) {
      const double a = matrix[i * n + k], b = matrix[k * n + i];
      if (std::abs(a - b) > 1e-9 * (std::abs(a) + std::abs(b))) {
        root.Fail(key, fmt::format("is not symmetric in row {} and column {}: {:.6g} and {:.6g}; "
                                   "allowed: the same number",
                                   i + 1, k + 1, a, b));
      }
    }
  }
  try {
    static_cast<void>(LowerFactor(matrix, n));
  } catch (const std::invalid_argument& error) {
    root.Fail(key, error.what());
  }
  return matrix;
}

PosteriorFile Read(TomlTable root, const Scene* scene) {
  ReadHeader(root, kPosteriorHeader);
  PosteriorFile file;
  ReadKeys(root, kPosteriorKeys, file);
  ReadKeys(root, kPosteriorRateKeys, file.drives);
  if (!file.effective && file.chi_max > 0 && file.chi > file.chi_max) {
    root.Fail("effective",
              fmt::format("is false, but chi is {:.6g}, and its limit {:.6g}; allowed: true, as "
                          "tumbler identify fit has written it",
                          file.chi, file.chi_max));
  }
  if (file.weight_kg > 0 && !file.weighed)
    root.Fail("weight_kg", "is there, but weighed is false; allowed: with weighed = true");
  if (!file.fingerprints.empty() && file.fingerprints.size() != file.records.size()) {
    root.Fail("fingerprints", fmt::format("are {}; allowed: one for each of the {} records",
                                          file.fingerprints.size(), file.records.size()));
  }
  std::vector<TomlTable> tables = root.Tables("quantity");
  for (TomlTable& table : tables) {
    QuantityEntry entry;
    ReadKeys(table, kQuantityKeys, entry);
    Check(table, entry, scene);
    const RobotQuantity quantity{entry.kind, entry.of};
    for (const RobotQuantity& other : file.posterior.quantities) {
      if (other == quantity)
        table.Fail("kind", fmt::format("is that of '{}' a second time", NameOf(quantity)));
    }
    file.posterior.quantities.push_back(quantity);
    file.posterior.mean.push_back(entry.mean);
    file.prior_deviations.push_back(entry.prior_deviation);
    file.information.centre.push_back(entry.unbounded_mean.value_or(entry.mean));
  }
  const std::size_t n = file.posterior.size();
  file.posterior.covariance = ReadMatrix(root, "covariance", "variance", n);
  for (std::size_t i = 0; i < n; ++i) {
    const QuantityFacts& facts = FactsOf(file.posterior.quantities[i].kind);
    const double deviation = file.posterior.DeviationOf(i);
    const double widest = facts.most_coordinate() - facts.least_coordinate();
    if (deviation <= widest) continue;
    root.Fail("covariance",
              fmt::format("has a variance of {:.6g} in row {}, that of the {}; allowed: at most "
                          "{:.6g}",
                          deviation * deviation, i + 1, NameOf(file.posterior.quantities[i]),
                          widest * widest));
  }
  if (root.Has("hessian")) {
    file.information.hessian = ReadMatrix(root, "hessian", "second derivative", n);
    file.information.gradient_covariance = ReadMatrix(root, "gradient_covariance", "variance", n);
  } else {
    root.Expect("hessian");
    root.Expect("gradient_covariance");
    file.information = {};
  }
  for (TomlTable& table : root.OptionalTables("drive")) {
    PosteriorDrive drive;
    ReadKeys(table, kPosteriorDriveKeys, drive);
    for (const PosteriorDrive& other : file.drives.of_joint) {
      if (other.joint == drive.joint)
        table.Fail("joint", fmt::format("'{}' has a drive already", drive.joint));
    }
    file.drives.of_joint.push_back(std::move(drive));
  }
  root.RejectUnknownKeys();
  return file;
}

}  // namespace

PosteriorFile ParsePosterior(std::string_view text, const std::string& name, const Scene* scene) {
  return Read(TomlTable::Parse(text, name), scene);
}

PosteriorFile LoadPosterior(const std::string& path, const Scene* scene) {
  return Read(TomlTable::ParseFile(path), scene);
}

std::vector<KeyTable> PosteriorKeyTables() {
  const char* const source = "offline/problem/posterior_toml.cc";
  std::vector<KeyRow> root = {RowOf(kPosteriorHeader)};
  for (KeyRow& row : RowsOf(kPosteriorKeys)) root.push_back(std::move(row));
  for (KeyRow& row : RowsOf(kPosteriorRateKeys)) root.push_back(std::move(row));
  return {{source, "posterior", root},
          {source, "quantity", RowsOf(kQuantityKeys)},
          {source, "posterior drive", RowsOf(kPosteriorDriveKeys)}};
}

}  // namespace tumbler
