#pragma once

#include <mujoco/mujoco.h>

#include <array>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <string>

#include "tests/support/files.h"

namespace tumbler::testing {

struct MujocoDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using MujocoModel = std::unique_ptr<mjModel, MujocoDeleter>;
using MujocoData = std::unique_ptr<mjData, MujocoDeleter>;

/// @throws std::runtime_error  with what MuJoCo says of the text.
inline MujocoModel LoadMjcf(const std::string& mjcf) {
  const TemporaryFolder folder;
  const std::string file = folder.path() / "model.xml";
  WriteFile(file, mjcf);
  std::array<char, 1000> error{};
  MujocoModel model(mj_loadXML(file.c_str(), nullptr, error.data(), error.size()));
  if (model == nullptr) throw std::runtime_error(error.data());
  return model;
}

/// The numbers of an object in one of MuJoCo's arrays, `size` for each.
template <int size>
mjtNum* NumbersOf(mjtNum* all, int object) {
  return all + static_cast<std::ptrdiff_t>(size) * object;
}

}  // namespace tumbler::testing
