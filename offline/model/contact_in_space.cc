// Contacts in space.
#include "offline/model/contact_model.h"
#include "offline/model/contact_model_body.h"
#include "offline/model/near_points_body.h"
#include "offline/model/signed_distance_body.h"
#include "offline/model/spatial.h"

namespace tumbler {

template NearPoints<Spatial> FindNearPoints(const PosedShape<Spatial>&, const PosedShape<Spatial>&);
template NearPointsDerivative<Spatial> DifferentiateNearPoints(const PosedShape<Spatial>&,
                                                               const PosedShape<Spatial>&,
                                                               const NearPoints<Spatial>&);
template SignedDistance<Spatial> FindSignedDistance(const PosedShape<Spatial>&,
                                                    const PosedShape<Spatial>&);
template class ContactModel<Spatial>;

}  // namespace tumbler
