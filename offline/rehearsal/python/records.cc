// Flight records in Python.

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

#include "offline/rehearsal/python/arrays.h"
#include "offline/rehearsal/python/bindings.h"
#include "offline/rehearsal/python/loaded_record.h"

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

py::object ColumnNamed(const RecordPointer& self, const std::string& wanted) {
  for (const auto& [name, column] : self->ticks.columns()) {
    if (name == wanted) return ColumnArray(column, self);
  }
  throw py::key_error(wanted);
}

}  // namespace

void BindRecords(py::module_& module) {
  py::class_<LoadedRecord, RecordPointer>(
      module, "Record",
      "A flight record: every tick of a run, as columns with units in their names.")
      .def_static(
          "load",
          [](const std::filesystem::path& path) {
            const py::gil_scoped_release release;
            return std::make_shared<LoadedRecord>(LoadRecord(path.string()));
          },
          py::arg("path"), "Reads a whole record. Throws RecordError.")
      .def_readonly("name", &LoadedRecord::name)
      .def_property_readonly(
          "joints", [](const LoadedRecord& self) { return py::tuple(py::cast(self.joints)); })
      .def_readonly("period_s", &LoadedRecord::period_s, "Of the control loop.")
      .def_readonly("remarks", &LoadedRecord::remarks,
                    "How the record ends, and what is lost or damaged.")
      .def_readonly("complete", &LoadedRecord::complete,
                    "Whether it ended in order, and nothing is lost or damaged.")
      .def_readonly("summary", &LoadedRecord::summary, "Several lines for people.")
      .def_property_readonly(
          "columns", [](const RecordPointer& self) { return ColumnsOf(self->ticks, self); },
          "All columns by name: those of the CSV that tumbler-record writes.")
      .def_property_readonly(
          "truth", [](const RecordPointer& self) { return ColumnsOf(self->truths, self); },
          "True states of a simulated robot, by the names of the message truth_t; else empty.")
      .def("__getitem__", &ColumnNamed, py::arg("column"))
      .def("__repr__",
           [](const LoadedRecord& self) { return "<tumbler.Record " + self.name + ">"; });
}

}  // namespace tumbler
