#include "offline/problem/task_frame.h"

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/model/spatial.h"
#include "offline/scene/quaternion.h"

namespace tumbler {

double TurnedAboutVertical(const SpaceMatrix& from, const SpaceMatrix& to) {
  const SpaceMatrix R = to * from.transpose();
  return portable::Atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1));
}

TaskFrame::TaskFrame(const PrimitivePose& entry, double x_m, double y_m, const SpaceMatrix& axes)
    : back_(Spatial::RotationBy(SpaceVector::UnitZ(),
                                -TurnedAboutVertical(ToRotation(entry.root_quaternion), axes))
                .m),
      began_(x_m, y_m, 0),
      entry_(entry.root_x_m, entry.root_y_m, 0) {}

void TaskFrame::Enter(std::span<double> q, std::span<double> qd, SpaceMatrix& axes) const {
  const SpaceVector place = back_ * (SpaceVector(q[0], q[1], q[2]) - began_) + entry_;
  const SpaceVector velocity = back_ * SpaceVector(qd[0], qd[1], qd[2]);
  for (int i = 0; i < 3; ++i) {
    q[Index(i)] = place[i];
    qd[Index(i)] = velocity[i];
  }
  axes = back_ * axes;
}

}  // namespace tumbler
