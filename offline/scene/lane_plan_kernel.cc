#define TUMBLER_LANES_NAMESPACE lanes_everywhere
#include "offline/scene/lane_plan_kernel.h"

#include "offline/scene/lane_plan.h"

namespace tumbler {

#if defined(__x86_64__)
const LanePlanKernel<Packet>& Avx2PlanKernel();
const LanePlanKernel<Packet>& Avx512PlanKernel();
#endif

const LanePlanKernel<double>& OneRobotPlanKernel() {
  static constexpr LanePlanKernel<double> kernel{"one robot", RunLanePlans<double, double>};
  return kernel;
}

std::vector<const LanePlanKernel<Packet>*> PacketPlanKernels() {
  static constexpr LanePlanKernel<Packet> plain{"SSE2", RunLanePlans<Packet, Vector<2>>};
  std::vector<const LanePlanKernel<Packet>*> kernels;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f")) kernels.push_back(&Avx512PlanKernel());
  if (__builtin_cpu_supports("avx2")) kernels.push_back(&Avx2PlanKernel());
#endif
  kernels.push_back(&plain);
  return kernels;
}

}  // namespace tumbler
