// The extension module tumbler._native, of which the package `tumbler` is made.

#include "offline/python/bindings.h"

// The macro is pybind11's.
// NOLINTNEXTLINE(readability-identifier-naming)
PYBIND11_MODULE(_native, module) {
  // Docstrings bring the signatures along (define.h).
  pybind11::options options;
  options.disable_function_signatures();
  module.attr("__version__") = TUMBLER_VERSION;
  tumbler::BindErrors(module);
  tumbler::BindMotions(module);
  tumbler::BindRecords(module);
  tumbler::BindModel(module);
  tumbler::BindTasks(module);
  tumbler::BindOptimising(module);
  tumbler::BindRehearsal(module);
}
