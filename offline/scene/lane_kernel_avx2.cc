// The lanes for processors with AVX2; compiled with the option that says so. What is compiled here
// is in a namespace of its own, so that the linker never takes it for other processors.

#define TUMBLER_LANES_NAMESPACE lanes_avx2
#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_peaks.h"
#include "offline/scene/lane_plan.h"
#include "offline/scene/lane_steps.h"

namespace tumbler {

const LaneKernel<Packet>& Avx2Kernel();
const LaneKernel<Packet>& Avx2Kernel() {
  static constexpr LaneKernel<Packet> kernel{
      "AVX2", DriveLanes<Packet, Vector<4>>, DriveLanesClassically<Packet, Vector<4>>,
      DriveSpaceLanesClassically<Packet, Vector<4>>, PrescribeLanes<Packet, Vector<4>>};
  return kernel;
}

const LanePlanKernel<Packet>& Avx2PlanKernel();
const LanePlanKernel<Packet>& Avx2PlanKernel() {
  static constexpr LanePlanKernel<Packet> kernel{"AVX2", RunLanePlans<Packet, Vector<4>>,
                                                 RunSpaceLanePlans<Packet, Vector<4>>,
                                                 FindLanePeaks<Packet, Vector<4>>};
  return kernel;
}

const RankingKernel& Avx2RankingKernel();
const RankingKernel& Avx2RankingKernel() {
  static constexpr RankingKernel kernel{"AVX2", DriveLanes<WidePacket, Vector<8, float>, float>};
  return kernel;
}

}  // namespace tumbler
