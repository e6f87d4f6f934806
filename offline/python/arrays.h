#pragma once

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace tumbler {

/// A NumPy array of numbers that lie in an object: nothing is copied, the object lives as long as
/// the array does, and the array is read-only.
/// @param shape  empty: of one dimension. Rows lie one behind the other.
template <typename Number, typename Owner>
pybind11::array_t<Number> ViewOf(std::span<const Number> numbers,
                                 const std::shared_ptr<Owner>& owner,
                                 std::vector<pybind11::ssize_t> shape = {}) {
  namespace py = pybind11;
  auto kept = std::make_unique<std::shared_ptr<Owner>>(owner);
  const py::capsule base(
      kept.get(), [](void* pointer) { delete static_cast<std::shared_ptr<Owner>*>(pointer); });
  kept.release();  // NOLINT(bugprone-unused-return-value): the capsule has it.
  if (shape.empty()) shape.push_back(static_cast<py::ssize_t>(numbers.size()));
  py::array_t<Number> view(std::move(shape), numbers.data(), base);
  view.attr("setflags")(py::arg("write") = false);
  return view;
}

/// A read-only NumPy array of its own numbers, which are moved into it.
template <typename Number>
pybind11::array_t<Number> ArrayOf(std::vector<Number> numbers,
                                  std::vector<pybind11::ssize_t> shape = {}) {
  const auto owner = std::make_shared<const std::vector<Number>>(std::move(numbers));
  return ViewOf(std::span<const Number>(*owner), owner, std::move(shape));
}

/// A read-only NumPy array of texts.
inline pybind11::array TextArray(const std::vector<std::string>& texts) {
  pybind11::array array =
      pybind11::module_::import("numpy").attr("array")(pybind11::cast(texts), "str");
  array.attr("setflags")(pybind11::arg("write") = false);
  return array;
}

}  // namespace tumbler
