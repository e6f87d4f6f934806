#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <type_traits>

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

  /// Keyword arguments of any name.
  void AddKeywords() { Append("**keys"); }

  [[nodiscard]] std::string WithDoc(const char* doc) const { return text_ + ")\n--\n\n" + doc; }

 private:
  void Append(const std::string& part) {
    if (text_.back() != '(') text_ += ", ";
    text_ += part;
  }

  std::string text_;
};

/// Whether a function takes keyword arguments of any name.
template <typename Signature>
struct TakesKeywords : std::false_type {};
template <typename Result, typename... Arguments>
struct TakesKeywords<Result(Arguments...)>
    : std::disjunction<std::is_same<std::decay_t<Arguments>, pybind11::kwargs>...> {};

template <typename Function, typename... Arguments>
std::string DocOf(const char* name, const char* doc, const Arguments&... arguments) {
  SignatureText signature(name);
  (signature.Add(arguments), ...);
  using Signature = pybind11::detail::function_signature_t<Function>;
  if constexpr (TakesKeywords<Signature>::value) signature.AddKeywords();
  return signature.WithDoc(doc);
}

/// Functions, methods and static methods of Python, with the signature of their `py::arg`s.

template <typename Function, typename... Arguments>
void DefineFunction(pybind11::module_& module, const char* name, const Function& function,
                    const char* doc, const Arguments&... arguments) {
  const std::string text = DocOf<Function>(name, doc, arguments...);
  module.def(name, function, arguments..., text.c_str());
}

template <typename Class, typename Function, typename... Arguments>
void DefineMethod(Class& of, const char* name, const Function& function, const char* doc,
                  const Arguments&... arguments) {
  const std::string text = DocOf<Function>(name, doc, pybind11::arg("self"), arguments...);
  of.def(name, function, arguments..., text.c_str());
}

template <typename Class, typename Function, typename... Arguments>
void DefineStatic(Class& of, const char* name, const Function& function, const char* doc,
                  const Arguments&... arguments) {
  const std::string text = DocOf<Function>(name, doc, arguments...);
  of.def_static(name, function, arguments..., text.c_str());
}

}  // namespace tumbler
