// Flight records in Python: their columns, of which tumbler/_record.py makes objects.

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "offline/python/arrays.h"
#include "offline/python/bindings.h"
#include "offline/python/loaded_record.h"
#include "offline/python/record_object.h"

namespace tumbler {
namespace {

namespace py = pybind11;
using RecordPointer = std::shared_ptr<LoadedRecord>;

/// A column as a view; texts as an array of its own.
py::object ColumnArray(const ColumnTable::Column& column, const RecordPointer& owner) {
  return std::visit(
      [&owner](const auto& values) -> py::object {
        using Value = typename std::remove_cvref_t<decltype(values)>::value_type;
        if constexpr (std::is_same_v<Value, const char*>) {
          py::object texts = py::module_::import("numpy").attr("array")(py::cast(values), "str");
          texts.attr("setflags")(py::arg("write") = false);
          return texts;
        } else {
          return ViewOf(std::span<const Value>(values), owner);
        }
      },
      column);
}

py::dict ColumnsOf(const ColumnTable& table, const RecordPointer& owner) {
  py::dict columns;
  for (const auto& [name, column] : table.columns())
    columns[py::str(name)] = ColumnArray(column, owner);
  return columns;
}

}  // namespace

py::object RecordObject(const std::shared_ptr<LoadedRecord>& record) {
  py::dict about;
  about["name"] = record->name;
  about["joints"] = py::tuple(py::cast(record->joints));
  about["period_s"] = record->period_s;
  about["remarks"] = py::tuple(py::cast(record->remarks));
  about["complete"] = record->complete;
  about["summary"] = record->summary;
  return py::module_::import("tumbler._record")
      .attr("Record")(ColumnsOf(record->ticks, record), ColumnsOf(record->truths, record), about);
}

void BindRecords(py::module_& module) {
  module.def("_load_record", [](const std::filesystem::path& path) {
    std::shared_ptr<LoadedRecord> record;
    {
      const py::gil_scoped_release release;
      record = std::make_shared<LoadedRecord>(LoadRecord(path.string()));
    }
    return RecordObject(record);
  });
}

}  // namespace tumbler
