#pragma once

#include <vector>

#include "common/key_table.h"
#include "common/toml_reader.h"
#include "offline/contact/contact_law.h"

namespace tumbler {

/// Reads the `[contact]` of a task over the law that `law` holds (docs/formats.md).
/// @param mass_kg, gravity_m_per_s2  of the robot, for a law that is given by what it is to do.
/// @throws FileError with file, line, key, value and allowed range.
void ReadContact(TomlTable& table, double mass_kg, double gravity_m_per_s2, ContactLaw& law);

/// The same of the forces alone: spring, damper and friction.
void ReadContactForces(TomlTable& table, ContactLaw& law);

/// The keys, for docs/formats.md.
KeyTable ContactKeyTable();

}  // namespace tumbler
