// Plans in lanes for processors with AVX-512, as lane_kernel_avx512.cc.

#define TUMBLER_LANES_NAMESPACE lanes_avx512
#include "offline/scene/lane_plan.h"
#include "offline/scene/lane_plan_kernel.h"

namespace tumbler {

const LanePlanKernel<Packet>& Avx512PlanKernel();
const LanePlanKernel<Packet>& Avx512PlanKernel() {
  static constexpr LanePlanKernel<Packet> kernel{"AVX-512", RunLanePlans<Packet, Vector<8>>};
  return kernel;
}

}  // namespace tumbler
