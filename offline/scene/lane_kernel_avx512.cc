// The lanes for processors with AVX-512; compiled with the option that says so. What is compiled
// here is in a namespace of its own, so that the linker never takes it for other processors.

#define TUMBLER_LANES_NAMESPACE lanes_avx512
#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_peaks.h"
#include "offline/scene/lane_plan.h"
#include "offline/scene/lane_steps.h"

namespace tumbler {

const LaneKernel<Packet>& Avx512Kernel();
const LaneKernel<Packet>& Avx512Kernel() {
  static constexpr LaneKernel<Packet> kernel{
      "AVX-512", DriveLanes<Packet, Vector<8>>, DriveLanesClassically<Packet, Vector<8>, Vector<4>>,
      DriveSpaceLanesClassically<Packet, Vector<8>>, PrescribeLanes<Packet, Vector<8>>};
  return kernel;
}

const LanePlanKernel<Packet>& Avx512PlanKernel();
const LanePlanKernel<Packet>& Avx512PlanKernel() {
  static constexpr LanePlanKernel<Packet> kernel{"AVX-512", RunLanePlans<Packet, Vector<8>>,
                                                 RunSpaceLanePlans<Packet, Vector<8>>,
                                                 FindLanePeaks<Packet, Vector<8>>};
  return kernel;
}

const RankingKernel& Avx512RankingKernel();
const RankingKernel& Avx512RankingKernel() {
  static constexpr RankingKernel kernel{"AVX-512",
                                        DriveLanes<WidePacket, Vector<16, float>, float>};
  return kernel;
}

}  // namespace tumbler
