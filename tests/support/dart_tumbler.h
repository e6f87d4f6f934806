#pragma once

#include <array>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/Joint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/utils/urdf/DartLoader.hpp>
#include <stdexcept>
#include <string>

#include "common/files/toml_reader.h"
#include "offline/model/planar_robot.h"
#include "tests/support/files.h"

namespace tumbler {

/// The joints of `LoadTumblerInDart`, in the order of the robot's degrees of freedom.
inline constexpr std::array<const char*, 5> kDartJoints = {"x", "z", "pitch", "leg1", "leg2"};

/// The shipped robot, read by DART's own loader from a URDF with the joints of the root.
inline dart::dynamics::SkeletonPtr LoadTumblerInDart() {
  const std::string path = testing::SourcePath("primitives/robots/tumbler.urdf");
  std::string urdf = ReadTextFile(path);
  const std::string root = R"(
    <link name="world"/>
    <link name="cart"/>
    <link name="lift"/>
    <joint name="x" type="prismatic">
      <parent link="world"/> <child link="cart"/> <axis xyz="1 0 0"/>
      <limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/>
    </joint>
    <joint name="z" type="prismatic">
      <parent link="cart"/> <child link="lift"/> <axis xyz="0 0 1"/>
      <limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/>
    </joint>
    <joint name="pitch" type="continuous">
      <parent link="lift"/> <child link="middle"/> <axis xyz="0 -1 0"/>
    </joint>
  )";
  urdf.insert(urdf.rfind("</robot>"), root);
  dart::utils::DartLoader loader;
  dart::dynamics::SkeletonPtr skeleton = loader.parseSkeletonString(urdf, "file://" + path);
  if (!skeleton) throw std::runtime_error("DART does not read the robot");
  // DART gives a link without inertia 1 kg.
  for (const char* massless : {"cart", "lift"}) {
    dart::dynamics::Inertia none;
    none.setMass(0);
    none.setMoment(0, 0, 0, 0, 0, 0);
    skeleton->getBodyNode(massless)->setInertia(none);
  }
  skeleton->setGravity({0, 0, -9.81});
  return skeleton;
}

}  // namespace tumbler
