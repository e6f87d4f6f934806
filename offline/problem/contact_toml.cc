#include "offline/problem/contact_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "common/files/file_keys.h"
#include "offline/model/contact_intent.h"
#include "offline/model/mesh_points.h"

namespace tumbler {
namespace {

constexpr Range kSlipSpeed{1e-6, Range::Positive().max};

/// The intended effect of contact on a robot under this gravity.
struct IntentEntry : ContactIntent {
  double gravity_m_per_s2 = 9.81;
};
constexpr std::array kIntentKeys = {
    KeyOf<&IntentEntry::static_penetration_m, IntentEntry>(
        "static_penetration_m", {1e-6, 0.1},
        "how deep the robot sinks with all its weight on `resting_contacts`")
        .Required()
        .Default("none"),
    KeyOf<&IntentEntry::settling_time_s, IntentEntry>(
        "settling_time_s", "after which 2 % of a bounce on `resting_contacts` are left")
        .Required()
        .Default("none")
        .Allowed("from 4 sqrt(penetration / g), to 100",
                 [](const IntentEntry& intent) {
                   return Range{
                       ShortestSettlingTime(intent.static_penetration_m, intent.gravity_m_per_s2),
                       100};
                 }),
    KeyOf<&IntentEntry::slip_speed_m_per_s, IntentEntry>("slip_speed_m_per_s", kSlipSpeed,
                                                         "v_max by its other name")
        .Required()
        .Default("none"),
    KeyOf<&IntentEntry::resting_contacts, IntentEntry>(
        "resting_contacts", {1, 20},
        "contacts that share the weight where penetration and settling time are as given"),
};

constexpr std::array kForceKeys = {
    KeyOf<&ContactLaw::stiffness_n_per_m>("stiffness_n_per_m", {0, 1e8, true}, "k"),
    KeyOf<&ContactLaw::damping_n_s_per_m>("damping_n_s_per_m", {0, 1e6}, "c"),
    KeyOf<&ContactLaw::v_max_m_per_s>("v_max_m_per_s", kSlipSpeed, "slip speed of full friction"),
};

struct LayerEntry : ContactLaw {
  double rest_m = 0;   ///< How deep the robot rests, by intent; 0 where that is not given.
  double least_m = 0;  ///< How deep it rests on a single contact.
};
constexpr std::array kLayerKeys = {
    KeyOf<&LayerEntry::d_on_m, LayerEntry>("d_on_m", "thickness of the compliant layer")
        .Default("{}; by intent `resting_contacts` + 2 penetrations")
        .Allowed("1e-6 (by intent: above `resting_contacts` penetrations) to 1",
                 [](const LayerEntry& layer) {
                   // In a thinner layer, the robot would rest on the core.
                   return layer.rest_m > 0 ? Range{layer.least_m, 1, true} : Range{1e-6, 1};
                 }),
    KeyOf<&LayerEntry::d_off_m, LayerEntry>("d_off_m", {0, 1},
                                            "distance below which the smoothing is 1")
        .Default(
            "{}, at most 3/4 of `d_on_m`; by intent `d_on_m` less 3/4 of a penetration, at least "
            "3/4 of `d_on_m`",
            [](LayerEntry& layer) {
              const double most_m = 0.75 * layer.d_on_m;
              // Where the robot rests, the smoothing is 1, as thick as the layer may be.
              layer.d_off_m = layer.rest_m > 0
                                  ? std::max(most_m, layer.d_on_m - 0.75 * layer.rest_m)
                                  : std::min(layer.d_off_m, most_m);
            })
        .Allowed("0 to below `d_on_m`"),
};

constexpr std::array kFrictionKeys = {
    KeyOf<&ContactLaw::mu>("mu", {0, 10}, ""),
};

constexpr std::array<std::string_view, 2> kSmoothing = {"cubic", "quintic"};
constexpr std::array<std::string_view, 3> kDampingLaws = {"no-pull", "signed", "printed"};
constexpr std::array kFormKeys = {
    KeyOf<&ContactLaw::smoothing>("smoothing", kSmoothing, ""),
    KeyOf<&ContactLaw::damping_law>("damping_law", kDampingLaws, ""),
};

constexpr std::array<std::string_view, 2> kMeshesAs = {"ignored", "points"};
constexpr std::array kMeshKeys = {
    KeyOf<&MeshContact::as>("meshes", kMeshesAs,
                            "collision meshes touch nothing, or with "
                            "[corners of their convex hulls](#meshes-in-contact)"),
    KeyOf<&MeshContact::most_points>("mesh_points", {kFewestMeshPoints, kMostMeshPoints},
                                     "the most of each mesh, where they are `points`"),
};

template <class S, std::size_t kCount>
bool HasAny(const TomlTable& table, const std::array<FileKey<S>, kCount>& keys) {
  bool any = false;
  for (const FileKey<S>& key : keys) any = table.Has(key.text.name) || any;
  return any;
}

/// Reads the law from its intended effect.
ContactIntent ReadIntent(TomlTable& table, double mass_kg, double gravity_m_per_s2,
                         ContactLaw& law) {
  for (const FileKey<ContactLaw>& direct : kForceKeys) {
    if (!table.Has(direct.text.name)) continue;
    table.Fail(direct.text.name,
               "is given beside static_penetration_m, settling_time_s or slip_speed_m_per_s, "
               "which it follows from; allowed: either these three, or stiffness_n_per_m, "
               "damping_n_s_per_m and v_max_m_per_s");
  }
  IntentEntry intent;
  intent.gravity_m_per_s2 = gravity_m_per_s2;
  ReadKeys(table, kIntentKeys, intent);
  law = LawFor(intent, mass_kg, gravity_m_per_s2, law);
  return intent;
}

}  // namespace

void ReadContact(TomlTable& table, double mass_kg, double gravity_m_per_s2, ContactLaw& law) {
  LayerEntry layer;
  if (HasAny(table, kIntentKeys)) {
    const ContactIntent intent = ReadIntent(table, mass_kg, gravity_m_per_s2, law);
    layer.rest_m = intent.static_penetration_m;
    layer.least_m = intent.resting_contacts * intent.static_penetration_m;
  } else {
    ReadKeys(table, kForceKeys, law);
  }
  static_cast<ContactLaw&>(layer) = law;
  ReadKeys(table, kLayerKeys, layer);
  law = layer;
  // With zero width, the derivative of the force would jump.
  if (law.d_off_m > law.d_on_m * (1 - 1e-6)) {
    table.Fail("d_off_m", fmt::format("is {}; allowed: from 0 to below d_on_m, which is {}",
                                      MessageNumber(law.d_off_m), MessageNumber(law.d_on_m)));
  }
  ReadKeys(table, kFrictionKeys, law);
  ReadKeys(table, kFormKeys, law);
}

MeshContact ReadMeshContact(TomlTable& root) {
  MeshContact meshes;
  if (std::optional<TomlTable> table = root.OptionalTable("contact"))
    ReadKeys(*table, kMeshKeys, meshes);
  return meshes;
}

void ReadContactForces(TomlTable& table, ContactLaw& law) {
  ReadKeys(table, kForceKeys, law);
  ReadKeys(table, kFrictionKeys, law);
}

KeyTable ContactKeyTable() {
  return {"offline/problem/contact_toml.cc", "contact",
          Joined({RowsOf(kIntentKeys), RowsOf(kForceKeys), RowsOf(kLayerKeys),
                  RowsOf(kFrictionKeys), RowsOf(kFormKeys), RowsOf(kMeshKeys)})};
}

}  // namespace tumbler
