#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "runtime/record/state_columns.h"

namespace tumbler {

/// A table whose columns have types of their own, and are found in the first row.
class ColumnTable {
 public:
  /// Texts are literals.
  using Column = std::variant<std::vector<std::int8_t>, std::vector<std::int32_t>,
                              std::vector<std::uint32_t>, std::vector<std::int64_t>,
                              std::vector<float>, std::vector<double>, std::vector<const char*>>;

  void BeginRow() { next_ = 0; }
  /// Appends a value to the next column of the row.
  template <typename Value>
  void Append(std::string_view name, const Value& value) {
    if (next_ == columns_.size()) columns_.emplace_back(name, std::vector<Value>());
    std::get<std::vector<Value>>(columns_[next_++].second).push_back(value);
  }
  void Append(std::string_view name, bool value) {
    Append(name, value ? std::int8_t{1} : std::int8_t{0});
  }
  void Append(std::string_view name, const ColumnTime& time) {
    Append(name, static_cast<double>(time.ns) * 1e-9);
  }
  void Append(std::string_view name, const ColumnFaultNumber& number) {
    Append(name, number.value);
  }

  [[nodiscard]] const std::vector<std::pair<std::string, Column>>& columns() const {
    return columns_;
  }

 private:
  std::vector<std::pair<std::string, Column>> columns_;
  std::size_t next_ = 0;
};

/// A flight record as Python has it.
struct LoadedRecord {
  std::string name;
  std::vector<std::string> joints;
  double period_s = 0;
  ColumnTable ticks;   ///< The columns of the CSV that `tumbler record` writes, without rounding.
  ColumnTable truths;  ///< True states of a simulated robot.
  std::vector<std::string> remarks;  ///< As of FlightRecord.
  bool complete = false;             ///< It ended in order, and nothing is lost or damaged.
  std::string summary;               ///< For people.
};

/// Reads a whole flight record. @throws RecordError
LoadedRecord LoadRecord(const std::string& path);

}  // namespace tumbler
