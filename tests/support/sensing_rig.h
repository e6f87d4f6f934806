#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "firmware_interface/devices/xsens_mti.h"
#include "tests/support/executor_rig.h"
#include "tests/support/sensor_motion.h"

namespace tumbler::testing {

/// An executor with or without a sensor, whose link is level to begin with.
class SensingRig : public ExecutorRig {
 public:
  SensingRig(const ExecutorConfig& config, bool has_sensor, const SequenceGraph<float>& graph,
             const Primitive<float>& motion)
      : SensingRig(config, has_sensor, graph, std::vector<Primitive<float>>{motion}) {}
  SensingRig(const ExecutorConfig& config, bool has_sensor, const SequenceGraph<float>& graph,
             const std::vector<Primitive<float>>& motions)
      : ExecutorRig(config, graph, motions) {
    if (has_sensor) {
      sensor.device = &device_;
      sensor.settings.repeats_max = 0;
      sensor.settings.jump_max_rad = 10;
    }
    Reconfigure();
    EXPECT_EQ(configured, Status::kOk);
    sensor_frames = SensorFrames(0, 0);
  }

 private:
  XsensMti device_;
};

}  // namespace tumbler::testing
