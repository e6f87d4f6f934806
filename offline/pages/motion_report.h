#pragma once

#include "offline/certify/certificate.h"
#include "offline/certify/chain.h"
#include "offline/pages/report.h"

namespace tumbler {

/// The data of a solution's report page: the motion until its exit, the solver's progress, and the
/// certificate.
ReportData MakeReportData(const Task& task, const SolveOutcome& outcome, const Solution& solution,
                          const PrimitiveFile& file);

/// The data of a chain's report page: all of its motions and holds. The chain is played again for
/// them.
ReportData MakeChainReport(const SimulatedMotion& motion, const ChainOptions& options);

}  // namespace tumbler
