#pragma once

#include <random>
#include <span>
#include <stdexcept>
#include <vector>

#include "common/files/sequence_toml.h"
#include "tests/support/motions.h"
#include "tests/support/random_aborts.h"
#include "tests/support/random_feedback.h"

namespace tumbler::testing {

/// A sequence that is hard to write as a header: it is as large as the runtime takes, has numbers
/// at both ends of single precision and both zeros among its coefficients, and names that a
/// compiler or a comment could trip over.
inline SequenceFile AwkwardMotion() {
  std::mt19937 random(4);
  SequenceFile file;
  file.path = "folder/\"quoted\" \\ name\n.toml";
  for (int i = 0; i < 2; ++i) {
    MotionShape shape;
    shape.joint_count = kMaxJoints;
    shape.control_points = i == 0 ? kMaxControlPoints : 7;
    shape.torque_points = i == 0 ? 5 : kMaxControlPoints;
    PrimitiveFile& primitive = file.primitives.emplace_back();
    primitive.primitive = RandomPrimitive<double>(shape, random);
    primitive.primitive.name = FixedString<48>("na\303\257ve \"?\?/\" \\");
    primitive.primitive.joints[0].name = FixedString<32>("joint\t0\\");
    JointMotion<double>& motion = primitive.primitive.joints[1];
    const auto knots = motion.torque.knots();
    std::vector<double> points(motion.torque.control_points().begin(),
                               motion.torque.control_points().end());
    points[0] = -0.0;
    points[1] = 0x1p-149;          // The smallest float,
    points[2] = -0x1.fffffcp-127;  // the largest subnormal one,
    points[3] = 0x1.fffffep+113;   // and one that is large.
    motion.limits.torque_max_nm = 0x1.fffffep+113;
    if (motion.torque.Assign(3, std::vector<double>(knots.begin(), knots.end()), points) !=
        Status::kOk) {
      throw std::logic_error("no spline");
    }
    file.primitive_names.emplace_back(i == 0 ? "first\nsecond line" : "");
  }
  // A path of another degree, on knots that are not uniform.
  const std::vector<double> knots{0,   0,   0,   0,   0,   0,   0,   0,   0.1,
                                  0.1, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2};
  const std::vector<double> points{0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1};
  if (file.primitives[1].primitive.joints[7].position.Assign(7, knots, points) != Status::kOk)
    throw std::logic_error("no spline");
  AddRandomFeedback(file.primitives[0], kMaxGainKnots, 5);
  file.primitives[0].primitive.feedback.link = FixedString<32>("li\"nk\n");
  file.primitives[0].chains[1].link = "li\"nk\n";
  file.primitives[0].primitive.aborts =
      RandomAborts(file.primitives[0].primitive, kMaxAbortSpans, random);
  file.primitives[1].primitive.joints[7].limits.position_min_rad = -1;
  file.primitives[1].primitive.joints[7].limits.position_max_rad = 1;

  SequenceGraph<double>& graph = file.graph;
  graph.name = FixedString<48>("3 r\303\264les, \"swapped\"");
  graph.start = 1;
  graph.node_count = kMaxSequenceNodes;
  for (int i = 0; i < kMaxSequenceNodes; ++i) {
    graph.node_storage[static_cast<std::size_t>(i)] = {FixedString<48>("node " + std::to_string(i)),
                                                       i % 2, i % 3 == 0, i % 5 == 0, i % 7 == 0};
  }
  graph.edge_count = kMaxSequenceEdges;
  for (int i = 0; i < kMaxSequenceEdges; ++i) {
    graph.edge_storage[static_cast<std::size_t>(i)] = {
        i % kMaxSequenceNodes, (i + 3) % kMaxSequenceNodes, 0.1 * i,
        static_cast<EdgeCondition>(i % 3), FixedString<32>(i % 3 == 1 ? "br\"anch" : "")};
  }
  for (std::size_t j = 0; j < graph.partner.size(); ++j)
    graph.partner[j] = static_cast<std::uint8_t>(graph.partner.size() - 1 - j);
  return file;
}

}  // namespace tumbler::testing
