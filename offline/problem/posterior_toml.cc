#include "offline/problem/posterior_toml.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <span>
#include <stdexcept>

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
    KeyOf<&PosteriorFile::chi_max>("chi_max", {0, 1e9}, "its limit").Required(),
    KeyOf<&PosteriorFile::weighed>("weighed", "otherwise masses and forces are in the drives' N m")
        .Required(),
    KeyOf<&PosteriorFile::records>("records", "that were fitted, for people").Allowed("names"),
};

/// A table `[[quantity]]`.
struct QuantityEntry {
  RobotQuantity::Kind kind = RobotQuantity::Kind::kMass;
  std::string of;
  double mean = 0, prior_deviation = 0;
};

constexpr std::array<std::string_view, RobotQuantity::kKinds> KindNames() {
  return {"mass",         "mass_centre",   "gyration",      "friction",  "stiffness",
          "damping",      "creep_speed",   "slope",         "zero",      "viscous_friction",
          "dry_friction", "rotor_inertia", "torque_factor", "reply_lag", "velocity_filter",
          "torque_lag"};
}
constexpr std::array kQuantityNames = KindNames();
constexpr Range kCoordinate{-1e6, 1e6};
constexpr std::array kQuantityKeys = {
    KeyOf<&QuantityEntry::kind>("kind", kQuantityNames, "what it is").Required(),
    KeyOf<&QuantityEntry::of>("of", "link or joint").Default("of the ground, or of all"),
    KeyOf<&QuantityEntry::mean>("mean", kCoordinate,
                                "coordinate: the value, or the logarithm of what is positive")
        .Required(),
    KeyOf<&QuantityEntry::prior_deviation>("prior_deviation", {0, 1e6},
                                           "of the coordinate, before the first record")
        .Required(),
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
  writer.Texts("records", file.records);
  const std::size_t n = file.posterior.size();
  writer.Line("# Of the quantities below, in their order and coordinates, row by row.");
  writer.Numbers("covariance", file.posterior.covariance);
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
  }
  return writer.Take();
}

namespace {

PosteriorFile Read(TomlTable root) {
  ReadHeader(root, kPosteriorHeader);
  PosteriorFile file;
  ReadKeys(root, kPosteriorKeys, file);
  for (TomlTable& table : root.Tables("quantity")) {
    QuantityEntry entry;
    ReadKeys(table, kQuantityKeys, entry);
    const RobotQuantity quantity{entry.kind, entry.of};
    for (const RobotQuantity& other : file.posterior.quantities) {
      if (other == quantity)
        table.Fail("kind", fmt::format("is that of '{}' a second time", NameOf(quantity)));
    }
    file.posterior.quantities.push_back(quantity);
    file.posterior.mean.push_back(entry.mean);
    file.prior_deviations.push_back(entry.prior_deviation);
  }
  const std::size_t n = file.posterior.size();
  file.posterior.covariance = root.Numbers("covariance", {-1e12, 1e12}, n * n);
  for (std::size_t i = 0; i < n; ++i) {
    if (!(file.posterior.covariance[i * n + i] > 0))
      root.Fail("covariance", fmt::format("has a variance of 0 or less in row {}", i + 1));
    for (std::size_t k = 0; k < i; ++k) {
      const double a = file.posterior.covariance[i * n + k];
      const double b = file.posterior.covariance[k * n + i];
      if (std::abs(a - b) > 1e-9 * (std::abs(a) + std::abs(b)))
        root.Fail("covariance",
                  fmt::format("is not symmetric in row {} and column {}", i + 1, k + 1));
    }
  }
  try {
    static_cast<void>(LowerFactor(file.posterior.covariance, n));
  } catch (const std::invalid_argument& error) {
    root.Fail("covariance", error.what());
  }
  root.RejectUnknownKeys();
  return file;
}

}  // namespace

PosteriorFile ParsePosterior(std::string_view text, const std::string& name) {
  return Read(TomlTable::Parse(text, name));
}

PosteriorFile LoadPosterior(const std::string& path) { return Read(TomlTable::ParseFile(path)); }

std::vector<KeyTable> PosteriorKeyTables() {
  const char* const source = "offline/problem/posterior_toml.cc";
  std::vector<KeyRow> root = {RowOf(kPosteriorHeader)};
  for (KeyRow& row : RowsOf(kPosteriorKeys)) root.push_back(std::move(row));
  return {{source, "posterior", root}, {source, "quantity", RowsOf(kQuantityKeys)}};
}

}  // namespace tumbler
