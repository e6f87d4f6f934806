#include "offline/pages/report_checks.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "common/core/functions.h"

namespace tumbler {

void RefuseField(const std::string& field, const std::string& problem) {
  throw std::invalid_argument(fmt::format("report: {}: {}", field, problem));
}

void CheckFinite(double value, const std::string& field) {
  if (!std::isfinite(value)) RefuseField(field, fmt::format("is {}, must be finite", value));
}

void CheckSize(std::size_t size, std::size_t expected, const std::string& field,
               std::string_view what) {
  if (size != expected) {
    RefuseField(field,
                fmt::format("has {} entries, must have {}: one for each {}", size, expected, what));
  }
}

void CheckUnit(double x, double z, const std::string& field) {
  CheckFinite(x, field + ".normal_x");
  CheckFinite(z, field + ".normal_z");
  const double length = portable::Length(x, z);
  if (std::abs(length - 1) > 1e-6) {
    RefuseField(field + ".normal", fmt::format("has length {}, must have length 1", length));
  }
}

void CheckSample(const ReportData& data, const std::vector<ReportSample>& samples,
                 std::size_t index) {
  const ReportSample& sample = samples[index];
  const std::string name = fmt::format("samples[{}]", index);
  CheckFinite(sample.time_s, name + ".time_s");
  if (index > 0 && sample.time_s <= samples[index - 1].time_s) {
    RefuseField(name + ".time_s", fmt::format("is {}, must be later than the {} before it",
                                              sample.time_s, samples[index - 1].time_s));
  }
  CheckFinite(sample.root_pitch_rad, name + ".root_pitch_rad");
  CheckSize(sample.link_poses.size(), data.links.size(), name + ".link_poses", "link");
  for (std::size_t k = 0; k < sample.link_poses.size(); ++k) {
    for (std::size_t c = 0; c < 3; ++c) {
      CheckFinite(sample.link_poses[k][c], fmt::format("{}.link_poses[{}][{}]", name, k, c));
    }
  }
  const auto check_joints = [&](const std::vector<double>& values, std::string_view field) {
    CheckSize(values.size(), data.joint_names.size(), fmt::format("{}.{}", name, field), "joint");
    for (std::size_t k = 0; k < values.size(); ++k) {
      CheckFinite(values[k], fmt::format("{}.{}[{}]", name, field, k));
    }
  };
  check_joints(sample.joint_positions_rad, "joint_positions_rad");
  check_joints(sample.joint_velocities_rad_s, "joint_velocities_rad_s");
  check_joints(sample.joint_torques_nm, "joint_torques_nm");
  for (std::size_t k = 0; k < sample.forces.size(); ++k) {
    const ReportSample::Force& force = sample.forces[k];
    const std::string of = fmt::format("{}.forces[{}]", name, k);
    CheckFinite(force.x_m, of + ".x_m");
    CheckFinite(force.z_m, of + ".z_m");
    CheckFinite(force.fx_n, of + ".fx_n");
    CheckFinite(force.fz_n, of + ".fz_n");
    CheckUnit(force.normal_x, force.normal_z, of);
  }
}

/// Checks a convex polygon with a radius: of a shape or an obstacle.
template <class S>
void CheckOutline(const S& outline, const std::string& name) {
  if (outline.corners_m.empty())
    RefuseField(name + ".corners_m", "is empty, must have at least one");
  for (std::size_t c = 0; c < outline.corners_m.size(); ++c) {
    CheckFinite(outline.corners_m[c][0], fmt::format("{}.corners_m[{}][0]", name, c));
    CheckFinite(outline.corners_m[c][1], fmt::format("{}.corners_m[{}][1]", name, c));
  }
  CheckFinite(outline.radius_m, name + ".radius_m");
  if (outline.radius_m < 0) {
    RefuseField(name + ".radius_m", fmt::format("is {}, must be at least 0", outline.radius_m));
  } else if (outline.radius_m == 0 && outline.corners_m.size() < 3) {
    RefuseField(name + ".radius_m", fmt::format("is {}, must be above 0", outline.radius_m));
  }
}

void CheckScene(const ReportData& data) {
  if (data.links.empty()) RefuseField("links", "is empty, must have at least the root");
  for (std::size_t k = 0; k < data.links.size(); ++k) {
    for (std::size_t s = 0; s < data.links[k].shapes.size(); ++s) {
      const ReportShape& shape = data.links[k].shapes[s];
      const std::string of = fmt::format("links[{}].shapes[{}]", k, s);
      CheckOutline(shape, of);
    }
  }
  const std::size_t joints = data.joint_names.size();
  if (data.joint_links.empty()) {
    if (joints >= data.links.size()) {
      RefuseField("joint_links",
                  fmt::format("is empty, and {} joints cannot move links 1 to {} of {}", joints,
                              joints, data.links.size()));
    }
  } else {
    CheckSize(data.joint_links.size(), joints, "joint_links", "joint");
    for (std::size_t k = 0; k < joints; ++k) {
      const int link = data.joint_links[k];
      if (link < 0 || link >= static_cast<int>(data.links.size())) {
        RefuseField(fmt::format("joint_links[{}]", k),
                    fmt::format("is {}, must be from 0 to {}", link, data.links.size() - 1));
      }
    }
  }
  if (!data.torque_limits_nm.empty()) {
    CheckSize(data.torque_limits_nm.size(), joints, "torque_limits_nm", "joint");
  }
  if (!data.position_limits_rad.empty()) {
    CheckSize(data.position_limits_rad.size(), joints, "position_limits_rad", "joint");
  }
  for (std::size_t k = 0; k < data.torque_limits_nm.size(); ++k) {
    CheckFinite(data.torque_limits_nm[k], fmt::format("torque_limits_nm[{}]", k));
  }
  for (std::size_t k = 0; k < data.position_limits_rad.size(); ++k) {
    CheckFinite(data.position_limits_rad[k][0], fmt::format("position_limits_rad[{}][0]", k));
    CheckFinite(data.position_limits_rad[k][1], fmt::format("position_limits_rad[{}][1]", k));
  }
  for (std::size_t k = 0; k < data.obstacles.size(); ++k) {
    const ReportObstacle& obstacle = data.obstacles[k];
    const std::string name = fmt::format("obstacles[{}]", k);
    CheckOutline(obstacle, name);
  }
  if (data.ground_z_m) CheckFinite(*data.ground_z_m, "ground_z_m");
}

}  // namespace tumbler
