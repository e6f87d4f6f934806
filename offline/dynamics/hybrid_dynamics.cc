#include "offline/dynamics/hybrid_dynamics.h"

#include "offline/dynamics/hybrid_dynamics_body.h"
#include "offline/dynamics/plane.h"

namespace tumbler {

template class HybridDynamics<Plane>;

}  // namespace tumbler
