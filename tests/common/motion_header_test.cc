#include "common/files/motion_header.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "awkward_motion_header.h"  // awkward_header wrote it.
#include "common/files/primitive_hash.h"
#include "tests/support/awkward_motion.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::uint32_t Bits(float x) { return std::bit_cast<std::uint32_t>(x); }

std::vector<std::uint32_t> Bits(std::span<const float> values) {
  std::vector<std::uint32_t> bits;
  for (const float value : values) bits.push_back(Bits(value));
  return bits;
}

std::vector<std::uint32_t> Bits(const JointLimits<float>& limits) {
  return {Bits(limits.position_min_rad), Bits(limits.position_max_rad),
          Bits(limits.velocity_max_rad_s), Bits(limits.acceleration_max_rad_s2),
          Bits(limits.torque_max_nm)};
}

void ExpectSame(const JointMotion<float>::Spline& a, const JointMotion<float>::Spline& b) {
  EXPECT_EQ(a.degree(), b.degree());
  EXPECT_EQ(Bits(a.knots()), Bits(b.knots()));
  for (int d = 0; d <= 2; ++d) EXPECT_EQ(Bits(a.control_points(d)), Bits(b.control_points(d)));
}

void ExpectSame(const Feedback<float>& a, const Feedback<float>& b) {
  EXPECT_EQ(a.link.view(), b.link.view());
  EXPECT_EQ(a.knot_count, b.knot_count);
  EXPECT_EQ(Bits(a.knots_s), Bits(b.knots_s));
  ExpectSame(a.angle, b.angle);
  EXPECT_EQ(Bits(a.error_min_rad), Bits(b.error_min_rad));
  EXPECT_EQ(Bits(a.error_full_rad), Bits(b.error_full_rad));
  EXPECT_EQ(Bits(a.error_max_rad), Bits(b.error_max_rad));
  EXPECT_EQ(Bits(a.start_error_max_rad), Bits(b.start_error_max_rad));
  EXPECT_EQ(Bits(a.fade_in_s), Bits(b.fade_in_s));
  EXPECT_EQ(Bits(a.fade_out_s), Bits(b.fade_out_s));
  for (std::size_t j = 0; j < a.joints.size(); ++j) {
    EXPECT_EQ(Bits(a.joints[j].chain), Bits(b.joints[j].chain));
    EXPECT_EQ(Bits(a.joints[j].angle_gain), Bits(b.joints[j].angle_gain));
    EXPECT_EQ(Bits(a.joints[j].rate_gain), Bits(b.joints[j].rate_gain));
    EXPECT_EQ(Bits(a.joints[j].correction_max_rad), Bits(b.joints[j].correction_max_rad));
    EXPECT_EQ(Bits(a.joints[j].correction_rate_max_rad_s),
              Bits(b.joints[j].correction_rate_max_rad_s));
  }
}

void ExpectSame(const Primitive<float>& a, const Primitive<float>& b) {
  EXPECT_EQ(a.name.view(), b.name.view());
  EXPECT_EQ(Bits(a.duration_s), Bits(b.duration_s));
  EXPECT_EQ(Bits(a.settle_s), Bits(b.settle_s));
  EXPECT_EQ(Bits(a.entry_tolerance_rad), Bits(b.entry_tolerance_rad));
  EXPECT_EQ(Bits(a.following_tolerance_rad), Bits(b.following_tolerance_rad));
  ASSERT_EQ(a.joint_count, b.joint_count);
  for (std::size_t j = 0; j < a.joints.size(); ++j) {
    SCOPED_TRACE("joint " + std::to_string(j));
    EXPECT_EQ(a.joints[j].name.view(), b.joints[j].name.view());
    ExpectSame(a.joints[j].position, b.joints[j].position);
    ExpectSame(a.joints[j].torque, b.joints[j].torque);
    EXPECT_EQ(Bits(a.joints[j].limits), Bits(b.joints[j].limits));
  }
  ExpectSame(a.feedback, b.feedback);
  ASSERT_EQ(a.aborts.span_count, b.aborts.span_count);
  for (std::size_t i = 0; i < a.aborts.spans().size(); ++i) {
    const AbortSpan<float>& x = a.aborts.span_storage[i];
    const AbortSpan<float>& y = b.aborts.span_storage[i];
    EXPECT_EQ(Bits(x.until_s), Bits(y.until_s));
    EXPECT_EQ(x.way, y.way);
    EXPECT_EQ(Bits(x.late_max_s), Bits(y.late_max_s));
    EXPECT_EQ(Bits(x.limits_share), Bits(y.limits_share));
    EXPECT_EQ(Bits(x.position_rad), Bits(y.position_rad));
  }
}

void ExpectSame(const SequenceGraph<float>& a, const SequenceGraph<float>& b) {
  EXPECT_EQ(a.name.view(), b.name.view());
  EXPECT_EQ(a.start, b.start);
  ASSERT_EQ(a.node_count, b.node_count);
  for (int i = 0; i < a.node_count; ++i) {
    EXPECT_EQ(a.node(i).name.view(), b.node(i).name.view());
    EXPECT_EQ(a.node(i).primitive, b.node(i).primitive);
    EXPECT_EQ(a.node(i).swapped, b.node(i).swapped);
    EXPECT_EQ(a.node(i).safe, b.node(i).safe);
    EXPECT_EQ(a.node(i).ends_cycle, b.node(i).ends_cycle);
    EXPECT_EQ(a.node(i).after_fall, b.node(i).after_fall);
  }
  ASSERT_EQ(a.edge_count, b.edge_count);
  for (int i = 0; i < a.edge_count; ++i) {
    EXPECT_EQ(a.edge(i).from, b.edge(i).from);
    EXPECT_EQ(a.edge(i).to, b.edge(i).to);
    EXPECT_EQ(Bits(a.edge(i).settle_s), Bits(b.edge(i).settle_s));
    EXPECT_EQ(a.edge(i).when, b.edge(i).when);
    EXPECT_EQ(a.edge(i).branch.view(), b.edge(i).branch.view());
  }
  EXPECT_EQ(a.partner, b.partner);
}

TEST(MotionHeader, HoldsEveryBitOfWhatTheLoaderGives) {
  const auto sequence =
      std::make_unique<const Sequence<float>>(ToRuntime(testing::AwkwardMotion()));
  ASSERT_EQ(awkward::motion::kPrimitives.size(),
            static_cast<std::size_t>(sequence->primitive_count));
  for (std::size_t i = 0; i < awkward::motion::kPrimitives.size(); ++i) {
    SCOPED_TRACE("primitive " + std::to_string(i));
    ExpectSame(awkward::motion::kPrimitives[i], sequence->primitives[i]);
  }
  ExpectSame(awkward::motion::kGraph, sequence->graph);
}

TEST(MotionHeader, IsUsableInConstants) {
  static_assert(awkward::motion::kPrimitives[0].joint_count == kMaxJoints);
  static_assert(awkward::motion::kGraph.FindBranch("br\"anch") == 1);
  static_assert(awkward::motion::kGraph.FindNode("node 15") == 15);
}

TEST(MotionHeader, NamesItsSourceAndTheHashOfItsText) {
  EXPECT_EQ(awkward::motion::kSource, "\"quoted\" \\ name\n.toml");
  EXPECT_EQ(awkward::motion::kSourceHash, HashOfText("the text of the file"));
}

TEST(MotionHeader, TakesItsNamespaceFromTheMotionsName) {
  EXPECT_THAT(ToHeader(testing::AwkwardMotion(), ""),
              HasSubstr("namespace motion_3_r_les_swapped_ {"));
}

TEST(MotionHeader, RefusesWhatIsNoNamespace) {
  for (const char* name : {"a b", "::a", "a::", "a:b", "1a", "a__b", "_a", "na\303\257ve", "a;"}) {
    EXPECT_THAT([&] { ToHeader(testing::AwkwardMotion(), "", name); },
                ThrowsMessage<std::invalid_argument>(HasSubstr("is not a namespace")))
        << name;
  }
}

TEST(MotionHeader, RefusesAPrimitiveThatDoesNotFitSinglePrecision) {
  SequenceFile file = testing::AwkwardMotion();
  file.primitives[1].primitive.duration_s = 1e-60;
  EXPECT_THAT([&] { ToHeader(file, ""); },
              ThrowsMessage<std::invalid_argument>(HasSubstr("does not fit single precision")));
}

TEST(MotionHeader, RefusesASplineWhoseDerivativesOverflow) {
  SequenceFile file = testing::AwkwardMotion();
  JointMotion<double>& motion = file.primitives[0].primitive.joints[2];
  motion.limits.torque_max_nm = 3e38;
  const std::vector<double> knots(motion.torque.knots().begin(), motion.torque.knots().end());
  ASSERT_EQ(motion.torque.Assign(3, knots, std::vector<double>{3e38, -3e38, 0, 0, 0}), Status::kOk);
  EXPECT_THAT([&] { ToHeader(file, ""); },
              ThrowsMessage<std::invalid_argument>(HasSubstr("joint 'joint3': derivative 1")));
}

}  // namespace
}  // namespace tumbler
