#include "offline/model/near_points.h"

#include "offline/model/near_points_body.h"
#include "offline/model/plane.h"

namespace tumbler {

template NearPoints<Plane> FindNearPoints(const PosedShape<Plane>&, const PosedShape<Plane>&);
template NearPointsDerivative<Plane> DifferentiateNearPoints(const PosedShape<Plane>&,
                                                             const PosedShape<Plane>&,
                                                             const NearPoints<Plane>&);

}  // namespace tumbler
