#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "offline/model/pose.h"
#include "offline/model/tree.h"
#include "tests/support/random_robot.h"

namespace tumbler {

/// A file, and the tree that it describes, which is made of poses in the world alone.
struct RandomSdf {
  std::string text;
  Tree<Spatial> tree;
};

class RandomSdfMaker {
 public:
  explicit RandomSdfMaker(std::mt19937_64& random) : random_(random) {}

  RandomSdf Make() {
    const Pose model = RandomPose();
    text_ = fmt::format("<sdf version='1.9'><model name='random'>\n<pose>{}</pose>\n", last_);
    known_.emplace_back("__model__", Pose{});
    const bool on_world = random_() % 2 == 0;
    const int links = 2 + static_cast<int>(random_() % 5);
    std::vector<int> dof_of;     // the degree of freedom that moves a link
    std::vector<Pose> frame_of;  // of the joint that carries it
    for (int i = 0; i < links; ++i) {
      const std::string link = fmt::format("link{}", i);
      const Pose at = Place("link", link);
      const double mass = Uniform(random_, 0.2, 2);
      const SpaceMatrix I = RandomInertia(random_);
      const Pose centre = at * RandomPose();
      text_ += fmt::format(
          "<inertial><pose>{}</pose><mass>{}</mass><inertia><ixx>{}</ixx><ixy>{}</ixy>"
          "<ixz>{}</ixz><iyy>{}</iyy><iyz>{}</iyz><izz>{}</izz></inertia></inertial></link>\n",
          last_, mass, I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2));
      known_.emplace_back(link, at);
      const SpaceMatrix turned = centre.rotation * I * centre.rotation.transpose();
      int parent = -1;
      Pose frame = at;
      if (i > 0 || on_world) {
        parent = i == 0 ? -1 : static_cast<int>(random_() % static_cast<unsigned>(i));
        frame = AddJoint(i, parent, at);
      } else {
        // Axes are those of the root link, and so is the place.
        root_ = at;
      }
      if (i == 0 && !on_world) {
        dof_of.push_back(-1);
        frame_of.push_back(at);
      } else {
        Dof<Spatial> dof = joint_;
        dof.parent = parent < 0 ? -1 : dof_of[Index(parent)];
        const SpaceVector above = dof.parent >= 0 ? frame_of[Index(parent)].translation
                                  : on_world      ? WorldOrigin(model)
                                                  : root_.translation;
        dof.offset = frame.translation - above;
        dof.mass_kg = mass;
        dof.mass_centre = centre.translation - frame.translation;
        dof.inertia_kg_m2 = turned;
        dof_of.push_back(static_cast<int>(tree_.dofs.size()));
        frame_of.push_back(frame);
        tree_.dofs.push_back(dof);
      }
      if (random_() % 2 == 0) {
        const std::string name = fmt::format("frame{}", i);
        const Pose placed = Place("frame", name);
        text_ += "</frame>\n";
        known_.emplace_back(name, placed);
      }
    }
    // From the model's axes into those of the world, or of the root link.
    const SpaceMatrix to = on_world ? model.rotation : root_.rotation.transpose();
    for (Dof<Spatial>& dof : tree_.dofs) {
      dof.axis = to * dof.axis;
      dof.direction = dof.axis;
      dof.offset = to * dof.offset;
      dof.mass_centre = to * dof.mass_centre;
      dof.inertia_kg_m2 = to * dof.inertia_kg_m2 * to.transpose();
    }
    tree_.gravity = {0, 0, -9.81};
    text_ += "</model></sdf>\n";
    return {text_, tree_};
  }

 private:
  static SpaceVector WorldOrigin(const Pose& model) {
    return -model.rotation.TransposeTimes(model.translation);
  }

  Pose RandomPose() {
    const SpaceVector p = RandomVector(random_, 0.4), a = RandomVector(random_, 3);
    last_ = fmt::format("{} {} {} {} {} {}", p.x(), p.y(), p.z(), a.x(), a.y(), a.z());
    const auto turn = [](double angle, int about) {
      SpaceMatrix R = SpaceMatrix::Identity();
      const int i = (about + 1) % 3, k = (about + 2) % 3;
      R(i, i) = R(k, k) = std::cos(angle);
      R(k, i) = std::sin(angle);
      R(i, k) = -std::sin(angle);
      return R;
    };
    return {turn(a.z(), 2) * turn(a.y(), 1) * turn(a.x(), 0), p};
  }

  const std::pair<std::string, Pose>& AnyFrame() { return known_[random_() % known_.size()]; }

  /// Begins an element at a place that is relative to any frame there is.
  Pose Place(const char* element, const std::string& name) {
    const auto& [to, frame] = AnyFrame();
    const Pose pose = frame * RandomPose();
    text_ +=
        fmt::format("<{} name='{}'><pose relative_to='{}'>{}</pose>", element, name, to, last_);
    return pose;
  }

  Pose AddJoint(int child, int parent, const Pose& link) {
    const std::string name = fmt::format("joint{}", child);
    const bool slides = random_() % 3 == 0;
    text_ += fmt::format("<joint name='{}' type='{}'><parent>{}</parent><child>link{}</child>",
                         name, slides ? "prismatic" : "revolute",
                         parent < 0 ? "world" : fmt::format("link{}", parent), child);
    Pose frame = link * RandomPose();
    if (random_() % 2 == 0) {
      text_ += fmt::format("<pose>{}</pose>", last_);  // Relative to the child.
    } else {
      const auto& [to, of] = AnyFrame();
      frame = of * RandomPose();
      text_ += fmt::format("<pose relative_to='{}'>{}</pose>", to, last_);
    }
    const SpaceVector xyz = RandomDirection(random_);
    SpaceMatrix axes = frame.rotation;
    std::string in;
    if (random_() % 2 == 0) {
      const auto& [to, of] = AnyFrame();
      axes = of.rotation;
      in = fmt::format(" expressed_in='{}'", to);
    }
    joint_ = Dof<Spatial>{};
    joint_.kind = slides ? JointKind::kPrismatic : JointKind::kRevolute;
    joint_.axis = axes * xyz;
    joint_.damping_nm_s_per_rad = Uniform(random_, 0, 0.5);
    text_ += fmt::format(
        "<axis><xyz{}>{} {} {}</xyz><dynamics><damping>{}</damping></dynamics></axis></joint>\n",
        in, xyz.x(), xyz.y(), xyz.z(), joint_.damping_nm_s_per_rad);
    known_.emplace_back(name, frame);
    return frame;
  }

  std::mt19937_64& random_;
  std::string text_, last_;                          // the last random pose
  std::vector<std::pair<std::string, Pose>> known_;  // in the model's frame
  Tree<Spatial> tree_;
  Dof<Spatial> joint_;
  Pose root_;
};

}  // namespace tumbler
