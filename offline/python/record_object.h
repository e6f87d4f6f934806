#pragma once

#include <pybind11/pybind11.h>

#include <memory>

#include "offline/python/loaded_record.h"

namespace tumbler {

/// The `tumbler.Record` of a flight record, whose arrays are views of its columns.
pybind11::object RecordObject(const std::shared_ptr<LoadedRecord>& record);

}  // namespace tumbler
