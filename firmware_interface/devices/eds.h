#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace tumbler {

/// An object of a device, or a part of one, as its electronic data sheet describes it.
struct EdsObject {
  std::uint32_t line = 0;  ///< Of its section.
  std::uint16_t type = 0;  ///< DataType, as CiA 301 numbers them.
  int bits = 0;            ///< Of the type; 0: it is no number.
  bool is_signed = false;  ///< Likewise.
  std::string access;     ///< AccessType in small letters: `ro`, `wo`, `rw`, `rwr`, `rww`, `const`.
  bool mappable = false;  ///< PDOMapping
  std::optional<std::int64_t> low, high;  ///< LowLimit and HighLimit, where the file has them.

  [[nodiscard]] bool readable() const { return access != "wo"; }
  [[nodiscard]] bool writable() const { return access != "ro" && access != "const"; }
};

/// The objects of a CANopen device, from its electronic data sheet (EDS) or device configuration
/// file (DCF), CiA 306: sections `[1018]`, `[1018sub1]`, of lines `Key=Value`. Names of sections
/// and keys in any case; numbers decimal, hexadecimal after 0x, octal after 0, and sums with
/// `$NODEID`.
class ElectronicDataSheet {
 public:
  /// @param name     of the file, for messages.
  /// @param node_id  the value of `$NODEID`.
  /// @throws FileError  with line, and section or key: no text, a line that is none of these, a
  ///                    section or key that occurs twice, a value that is none of its kind, an
  ///                    object in a list without a section, or a file without objects.
  static ElectronicDataSheet Parse(std::string_view text, const std::string& name,
                                   std::uint8_t node_id);

  /// The object, or null if the device has none.
  [[nodiscard]] std::optional<EdsObject> Find(std::uint16_t index, std::uint8_t sub) const;
  [[nodiscard]] const std::string& name() const { return name_; }
  /// The number that a DCF gives its node.
  [[nodiscard]] std::optional<int> node_id() const { return node_id_; }

 private:
  std::string name_;
  std::map<std::pair<std::uint16_t, std::uint8_t>, EdsObject> objects_;
  /// Arrays whose parts have no sections of their own: how many there are after the first.
  std::map<std::uint16_t, int> compact_;
  std::optional<int> node_id_;
};

}  // namespace tumbler
