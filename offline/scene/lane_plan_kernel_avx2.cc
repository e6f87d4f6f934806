// Plans in lanes for processors with AVX2, as lane_kernel_avx2.cc.

#define TUMBLER_LANES_NAMESPACE lanes_avx2
#include "offline/scene/lane_plan.h"
#include "offline/scene/lane_plan_kernel.h"

namespace tumbler {

const LanePlanKernel<Packet>& Avx2PlanKernel();
const LanePlanKernel<Packet>& Avx2PlanKernel() {
  static constexpr LanePlanKernel<Packet> kernel{"AVX2", RunLanePlans<Packet, Vector<4>>};
  return kernel;
}

}  // namespace tumbler
