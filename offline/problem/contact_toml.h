#pragma once

#include <vector>

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "offline/model/contact_law.h"

namespace tumbler {

/// Reads the `[contact]` of a task (docs/formats.md) into `law`, whose values are the defaults.
/// @param mass_kg, gravity_m_per_s2  of the robot, for a law that is given by its intended effect.
/// @throws FileError  with file, line, key, value and allowed range.
void ReadContact(TomlTable& table, double mass_kg, double gravity_m_per_s2, ContactLaw& law);

/// What touches in the place of a collision mesh.
struct MeshContact {
  enum class As { kIgnored, kPoints };
  As as = As::kIgnored;
  int most_points = 16;  ///< Of each mesh (WithMeshPoints).
};

/// Reads of the `[contact]` of a task what becomes of its robot's meshes.
MeshContact ReadMeshContact(TomlTable& root);

/// Reads only the keys of the forces: spring, damper and friction.
void ReadContactForces(TomlTable& table, ContactLaw& law);

/// The keys, for docs/formats.md.
KeyTable ContactKeyTable();

}  // namespace tumbler
