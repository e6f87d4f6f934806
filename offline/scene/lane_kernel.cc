#define TUMBLER_LANES_NAMESPACE lanes_everywhere
#include "offline/scene/lane_kernel.h"

#include "offline/scene/lane_steps.h"

namespace tumbler {

#if defined(__x86_64__)
const LaneKernel<Packet>& Avx2Kernel();
const LaneKernel<Packet>& Avx512Kernel();
#endif

const LaneKernel<double>& OneRobotKernel() {
  static constexpr LaneKernel<double> kernel{"one robot", DriveLanes<double, double>,
                                             PrescribeLanes<double, double>};
  return kernel;
}

std::vector<const LaneKernel<Packet>*> PacketKernels() {
  static constexpr LaneKernel<Packet> plain{"SSE2", DriveLanes<Packet, Vectors<2>>,
                                            PrescribeLanes<Packet, Vectors<2>>};
  std::vector<const LaneKernel<Packet>*> kernels;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f")) kernels.push_back(&Avx512Kernel());
  if (__builtin_cpu_supports("avx2")) kernels.push_back(&Avx2Kernel());
#endif
  kernels.push_back(&plain);
  return kernels;
}

}  // namespace tumbler
