#pragma once

#include <pybind11/pybind11.h>

namespace tumbler {

// The parts of the Python module, each of which adds its classes and functions to it.

void BindErrors(pybind11::module_& module);
void BindMotions(pybind11::module_& module);
void BindRecords(pybind11::module_& module);
void BindTasks(pybind11::module_& module);
void BindModel(pybind11::module_& module);
void BindOptimising(pybind11::module_& module);
void BindRehearsal(pybind11::module_& module);

}  // namespace tumbler
