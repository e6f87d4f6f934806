#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "offline/model/plane.h"
#include "offline/model/spatial.h"
#include "offline/model/tree.h"

namespace tumbler {

inline double Uniform(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// A random tree of 1 to 8 joints with random branching, joint types, prescribed set, rotor inertia
/// and damping.
inline Tree<Plane> RandomTree(std::mt19937_64& random) {
  Tree<Plane> tree;
  tree.gravity = {Uniform(random, -3, 3), -9.81};
  const int n = 1 + static_cast<int>(random() % 8);
  for (int j = 0; j < n; ++j) {
    Dof<Plane> dof;
    dof.parent = j == 0 ? -1 : static_cast<int>(random() % static_cast<unsigned>(j + 1)) - 1;
    dof.kind = random() % 3 == 0 ? JointKind::kPrismatic : JointKind::kRevolute;
    dof.prescribed = random() % 2 == 0;
    dof.axis = random() % 2 == 0 ? 1 : -1;
    const double heading = Uniform(random, -3, 3);
    dof.direction = {std::cos(heading), std::sin(heading)};
    dof.offset = {Uniform(random, -0.5, 0.5), Uniform(random, -0.5, 0.5)};
    dof.mass_kg = Uniform(random, 0.2, 2);
    dof.mass_centre = {Uniform(random, -0.3, 0.3), Uniform(random, -0.3, 0.3)};
    dof.inertia_kg_m2 = Uniform(random, 0.001, 0.1);
    dof.rotor_inertia_kg_m2 = random() % 2 == 0 ? Uniform(random, 0, 0.01) : 0;
    dof.damping_nm_s_per_rad = random() % 2 == 0 ? Uniform(random, 0, 0.5) : 0;
    tree.dofs.push_back(dof);
  }
  return tree;
}

inline SpaceVector RandomVector(std::mt19937_64& random, double size) {
  return {Uniform(random, -size, size), Uniform(random, -size, size), Uniform(random, -size, size)};
}

inline SpaceVector RandomDirection(std::mt19937_64& random) {
  for (;;) {
    const SpaceVector v = RandomVector(random, 1);
    if (v.norm() > 0.1 && v.norm() < 1) return v.normalized();
  }
}

/// Moments of inertia of a body that can exist, in any orientation.
inline SpaceMatrix RandomInertia(std::mt19937_64& random) {
  SpaceMatrix sigma = SpaceMatrix::Zero();
  for (int point = 0; point < 4; ++point) {
    const SpaceVector r = RandomVector(random, 0.2);
    sigma += SpaceMatrix::Outer(r, r);
  }
  return sigma.trace() * SpaceMatrix::Identity() - sigma;
}

/// The same in space. Some bodies are massless where others follow, as in chains of joints that
/// meet in a point.
inline Tree<Spatial> RandomSpatialTree(std::mt19937_64& random, int max_dofs = 10) {
  Tree<Spatial> tree;
  tree.gravity = RandomVector(random, 9.81);
  const int n = 1 + static_cast<int>(random() % static_cast<unsigned>(max_dofs));
  for (int j = 0; j < n; ++j) {
    Dof<Spatial> dof;
    dof.parent = j == 0 ? -1 : static_cast<int>(random() % static_cast<unsigned>(j + 1)) - 1;
    dof.kind = random() % 3 == 0 ? JointKind::kPrismatic : JointKind::kRevolute;
    dof.prescribed = random() % 2 == 0;
    dof.axis = RandomDirection(random);
    dof.direction = RandomDirection(random);
    dof.offset = RandomVector(random, 0.5);
    dof.mass_kg = Uniform(random, 0.2, 2);
    dof.mass_centre = RandomVector(random, 0.3);
    dof.inertia_kg_m2 = RandomInertia(random);
    dof.rotor_inertia_kg_m2 = random() % 2 == 0 ? Uniform(random, 0, 0.01) : 0;
    dof.damping_nm_s_per_rad = random() % 2 == 0 ? Uniform(random, 0, 0.5) : 0;
    tree.dofs.push_back(dof);
  }
  // A body before a single follower may be massless, since the follower gives it inertia.
  if (n >= 3 && random() % 2 == 0) {
    Dof<Spatial>& between = tree.dofs[static_cast<std::size_t>(n - 2)];
    tree.dofs.back().parent = n - 2;
    between.massless = true;
    between.mass_kg = 0;
    between.mass_centre = SpaceVector::Zero();
    between.inertia_kg_m2 = SpaceMatrix::Zero();
  }
  return tree;
}

/// Positions, velocities and given inputs of one evaluation.
struct DynamicsState {
  std::vector<double> q, qd, qdd, tau;
};

inline DynamicsState RandomState(std::mt19937_64& random, std::size_t n, double scale = 1) {
  DynamicsState s{std::vector<double>(n), std::vector<double>(n), std::vector<double>(n),
                  std::vector<double>(n)};
  for (std::size_t i = 0; i < n; ++i) {
    s.q[i] = Uniform(random, -3, 3);
    s.qd[i] = Uniform(random, -4, 4) * scale;
    s.qdd[i] = Uniform(random, -20, 20);
    s.tau[i] = Uniform(random, -5, 5);
  }
  return s;
}

}  // namespace tumbler
