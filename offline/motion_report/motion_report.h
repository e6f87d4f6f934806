#pragma once

#include "offline/certificate/certificate.h"
#include "offline/chain/chain.h"
#include "offline/report/report.h"

namespace tumbler {

/// What the report page shows of a solution: the motion until its exit, the solver's progress, the
/// certificate.
ReportData MakeReportData(const Task& task, const SolveOutcome& outcome, const Solution& solution,
                          const PrimitiveFile& file);

/// What a report page shows of a chain: the whole of it, holds and all. Plays it again.
ReportData MakeChainReport(const SimulatedMotion& motion, const ChainOptions& options);

}  // namespace tumbler
