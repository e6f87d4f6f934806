#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <tuple>
#include <type_traits>
#include <utility>

namespace tumbler {

/// Tables of fields: tuples of rows, each with a `field` that describes it. Rows are of different
/// types, since each has its own functions that give members of structs.

/// Calls `visit(row)` for every row, in the order of the table.
template <typename Table, typename Visit>
constexpr void ForEachRow(const Table& table, const Visit& visit) {
  std::apply([&](const auto&... rows) { (visit(rows), ...); }, table);
}

/// The same, in the order of a place that the rows' fields have (a member that is an int).
template <const auto& kTable, auto kPlace, typename Visit>
constexpr void ForEachRowBy(const Visit& visit) {
  constexpr std::size_t kCount = std::tuple_size_v<std::remove_cvref_t<decltype(kTable)>>;
  constexpr auto kOrder = [] {
    std::array<int, kCount> places{};
    std::array<std::size_t, kCount> order{};
    std::size_t i = 0;
    ForEachRow(kTable, [&](const auto& row) {
      order[i] = i;
      places[i++] = row.field.*kPlace;
    });
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return places[a] < places[b]; });
    return order;
  }();
  [&]<std::size_t... kI>(std::index_sequence<kI...> /*numbers*/) {
    (visit(std::get<kOrder[kI]>(kTable)), ...);
  }
  (std::make_index_sequence<kCount>());
}

}  // namespace tumbler
