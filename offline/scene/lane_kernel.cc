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
                                             DriveLanesClassically<double, double>,
                                             PrescribeLanes<double, double>};
  return kernel;
}

std::vector<const LaneKernel<Packet>*> PacketKernels() {
  // Vectors of 16 bytes are what every processor of these has.
#if defined(__aarch64__)
  constexpr const char* kPlain = "NEON";
#else
  constexpr const char* kPlain = "SSE2";
#endif
  static constexpr LaneKernel<Packet> plain{kPlain, DriveLanes<Packet, Vector<2>>,
                                            DriveLanesClassically<Packet, Vector<2>>,
                                            PrescribeLanes<Packet, Vector<2>>};
  std::vector<const LaneKernel<Packet>*> kernels;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f")) kernels.push_back(&Avx512Kernel());
  if (__builtin_cpu_supports("avx2")) kernels.push_back(&Avx2Kernel());
#endif
  kernels.push_back(&plain);
  return kernels;
}

}  // namespace tumbler
