// The extension module tumbler._native, of which the package `tumbler` is made.

#include "offline/rehearsal/python/bindings.h"

// The macro is pybind11's.
// NOLINTNEXTLINE(readability-identifier-naming)
PYBIND11_MODULE(_native, module) {
  tumbler::BindErrors(module);
  tumbler::BindMotions(module);
  tumbler::BindRecords(module);
  tumbler::BindOptimising(module);
  tumbler::BindRehearsal(module);
}
