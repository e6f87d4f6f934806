#define TUMBLER_LANES_NAMESPACE lanes_everywhere
#include "offline/scene/lane_kernel.h"

#include "offline/scene/lane_peaks.h"
#include "offline/scene/lane_plan.h"
#include "offline/scene/lane_steps.h"

namespace tumbler {

// Vectors of 16 bytes are what every processor of these has.
#if defined(__x86_64__)
const LaneKernel<Packet>& Avx2Kernel();
const LaneKernel<Packet>& Avx512Kernel();
const LanePlanKernel<Packet>& Avx2PlanKernel();
const LanePlanKernel<Packet>& Avx512PlanKernel();
const RankingKernel& Avx2RankingKernel();
const RankingKernel& Avx512RankingKernel();

namespace {

constexpr const char* kPlain = "SSE2";

/// Those that this processor can run, the fastest first.
template <class Kernel>
std::vector<const Kernel*> Runnable(const Kernel& (*avx512)(), const Kernel& (*avx2)(),
                                    const Kernel& plain) {
  std::vector<const Kernel*> kernels;
  if (__builtin_cpu_supports("avx512f")) kernels.push_back(&avx512());
  if (__builtin_cpu_supports("avx2")) kernels.push_back(&avx2());
  kernels.push_back(&plain);
  return kernels;
}

}  // namespace
#else
namespace {
#if defined(__aarch64__)
constexpr const char* kPlain = "NEON";
#else
constexpr const char* kPlain = "16 bytes";
#endif
}  // namespace
#endif

const LaneKernel<double>& OneRobotKernel() {
  static constexpr LaneKernel<double> kernel{
      "one robot", DriveLanes<double, double>, DriveLanesClassically<double, double>,
      DriveSpaceLanesClassically<double, double>, PrescribeLanes<double, double>};
  return kernel;
}

const LanePlanKernel<double>& OneRobotPlanKernel() {
  static constexpr LanePlanKernel<double> kernel{"one robot", RunLanePlans<double, double>,
                                                 RunSpaceLanePlans<double, double>,
                                                 FindLanePeaks<double, double>};
  return kernel;
}

std::vector<const LaneKernel<Packet>*> PacketKernels() {
  static constexpr LaneKernel<Packet> plain{
      kPlain, DriveLanes<Packet, Vector<2>>, DriveLanesClassically<Packet, Vector<2>>,
      DriveSpaceLanesClassically<Packet, Vector<2>>, PrescribeLanes<Packet, Vector<2>>};
#if defined(__x86_64__)
  return Runnable(Avx512Kernel, Avx2Kernel, plain);
#else
  return {&plain};
#endif
}

std::vector<const LanePlanKernel<Packet>*> PacketPlanKernels() {
  static constexpr LanePlanKernel<Packet> plain{kPlain, RunLanePlans<Packet, Vector<2>>,
                                                RunSpaceLanePlans<Packet, Vector<2>>,
                                                FindLanePeaks<Packet, Vector<2>>};
#if defined(__x86_64__)
  return Runnable(Avx512PlanKernel, Avx2PlanKernel, plain);
#else
  return {&plain};
#endif
}

std::vector<const RankingKernel*> RankingKernels() {
  static constexpr RankingKernel plain{kPlain, DriveLanes<WidePacket, Vector<4, float>, float>};
#if defined(__x86_64__)
  return Runnable(Avx512RankingKernel, Avx2RankingKernel, plain);
#else
  return {&plain};
#endif
}

}  // namespace tumbler
