#include "offline/contact/contact_model.h"

#include "offline/contact/contact_model_body.h"
#include "offline/dynamics/plane.h"

namespace tumbler {

template class ContactModel<Plane>;

}  // namespace tumbler
