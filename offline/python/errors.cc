// What the module throws.

#include <exception>
#include <stdexcept>
#include <string>

#include "common/files/program.h"
#include "common/files/toml_reader.h"
#include "offline/python/bindings.h"
#include "offline/python/file_error_parts.h"
#include "runtime/record/record_configuration.h"

namespace tumbler {
namespace {

namespace py = pybind11;

constexpr const char* kFileErrorDoc =
    "A file that cannot be used.\n\n"
    "The whole message says what is wrong and what is allowed. `file`, `line` and `key` say "
    "where:\n"
    "`line` and `key` are None where the error is about no single one.";
constexpr const char* kRecordErrorDoc = "A flight record that cannot be used.";
constexpr const char* kRefusedDoc = "What was asked for is not done, although nothing is broken.";

void AddException(py::module_& module, const char* name, const char* doc, PyObject* base) {
  const std::string full = std::string("tumbler.") + name;
  module.attr(name) = py::reinterpret_steal<py::object>(
      PyErr_NewExceptionWithDoc(full.c_str(), doc, base, nullptr));
}

/// The exception's class, which the module has from its start to its end.
py::object ClassOf(const char* name) { return py::module_::import("tumbler._native").attr(name); }

void RaiseFileError(const std::string& message, const std::string& path) {
  const py::object of_class = ClassOf("FileError");
  const FileErrorParts parts = PartsOf(message, path);
  const py::object raised = of_class(message);
  raised.attr("file") = parts.file;
  raised.attr("line") = parts.line ? py::object(py::int_(*parts.line)) : py::none();
  raised.attr("key") = parts.key ? py::object(py::str(*parts.key)) : py::none();
  PyErr_SetObject(of_class.ptr(), raised.ptr());
}

}  // namespace

void BindErrors(py::module_& module) {
  AddException(module, "FileError", kFileErrorDoc, PyExc_ValueError);
  AddException(module, "RecordError", kRecordErrorDoc, PyExc_ValueError);
  AddException(module, "Refused", kRefusedDoc, PyExc_RuntimeError);
  py::register_exception_translator(
      [](std::exception_ptr pointer) {  // NOLINT(performance-unnecessary-value-param)
        try {
          if (pointer) std::rethrow_exception(pointer);
        } catch (const FileError& error) {
          RaiseFileError(error.what(), "");
        } catch (const ReadingError& error) {
          RaiseFileError(error.message, error.path);
        } catch (const RecordError& error) {
          PyErr_SetString(ClassOf("RecordError").ptr(), error.what());
        } catch (const Refused& error) {
          PyErr_SetString(ClassOf("Refused").ptr(), error.what());
        }
      });
}

}  // namespace tumbler
