#include "offline/model/hybrid_dynamics.h"

#include "offline/model/hybrid_dynamics_body.h"
#include "offline/model/plane.h"

namespace tumbler {

template class HybridDynamics<Plane>;

}  // namespace tumbler
