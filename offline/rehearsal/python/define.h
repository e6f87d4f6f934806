#pragma once

#include <pybind11/pybind11.h>

#include <string>

namespace tumbler {

/// The text of a function that `inspect.signature` reads: CPython takes the signature of a compiled
/// function from the head of its docstring, up to a line of two dashes, and shows the rest as
/// `__doc__`.
class SignatureText {
 public:
  explicit SignatureText(const char* name) : text_(std::string(name) + "(") {}

  void Add(const pybind11::arg& argument) { Append(argument.name); }
  void Add(const pybind11::arg_v& argument) {
    Append(std::string(argument.name) + "=" + pybind11::repr(argument.value).cast<std::string>());
  }
  void Add(const pybind11::kw_only& /*rest*/) { Append("*"); }
  void Add(const pybind11::pos_only& /*before*/) { Append("/"); }

  [[nodiscard]] std::string WithDoc(const char* doc) const { return text_ + ")\n--\n\n" + doc; }

 private:
  void Append(const std::string& part) {
    if (text_.back() != '(') text_ += ", ";
    text_ += part;
  }

  std::string text_;
};

template <typename... Arguments>
std::string DocOf(SignatureText signature, const char* doc, const Arguments&... arguments) {
  (signature.Add(arguments), ...);
  return signature.WithDoc(doc);
}

/// Functions, methods and static methods of Python, with the signature of their `py::arg`s.

template <typename Function, typename... Arguments>
void DefineFunction(pybind11::module_& module, const char* name, const Function& function,
                    const char* doc, const Arguments&... arguments) {
  const std::string text = DocOf(SignatureText(name), doc, arguments...);
  module.def(name, function, arguments..., text.c_str());
}

template <typename Class, typename Function, typename... Arguments>
void DefineMethod(Class& of, const char* name, const Function& function, const char* doc,
                  const Arguments&... arguments) {
  const std::string text = DocOf(SignatureText(name), doc, pybind11::arg("self"), arguments...);
  of.def(name, function, arguments..., text.c_str());
}

template <typename Class, typename Function, typename... Arguments>
void DefineStatic(Class& of, const char* name, const Function& function, const char* doc,
                  const Arguments&... arguments) {
  const std::string text = DocOf(SignatureText(name), doc, arguments...);
  of.def_static(name, function, arguments..., text.c_str());
}

}  // namespace tumbler
