#include "offline/model/contact_model.h"

#include "offline/model/contact_model_body.h"
#include "offline/model/plane.h"

namespace tumbler {

template class ContactModel<Plane>;

}  // namespace tumbler
