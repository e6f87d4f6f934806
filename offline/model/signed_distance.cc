#include "offline/model/signed_distance.h"

#include "offline/model/plane.h"
#include "offline/model/signed_distance_body.h"

namespace tumbler {

template SignedDistance<Plane> FindSignedDistance(const PosedShape<Plane>&,
                                                  const PosedShape<Plane>&);

}  // namespace tumbler
