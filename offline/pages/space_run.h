#pragma once

#include "offline/pages/flight_report.h"
#include "offline/pages/run_data.h"
#include "offline/pages/space_page.h"

namespace tumbler {

/// The page of a run of a robot in space: the robot as it truly moved, or, where that is not known,
/// its joints as they were measured, with the root where the motion begins; and of each joint
/// position, following error and torque.
/// @pre RunData::space.
/// @throws std::runtime_error  naming the file, when nothing of it is in the interval that is
/// shown.
SpaceMotionPage MakeSpaceRunPage(const RunData& run, const FlightReportOptions& options);

}  // namespace tumbler
